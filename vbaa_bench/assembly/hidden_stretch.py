"""Choice of the stretch of the beam that a frame hides."""

import numpy as np

from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.frames import Cover

# A stretch about the contact has it at a random place in its middle 80 %: a fixed place would
# reveal the contact.
MAX_OFFSET = 0.4


def hidden_stretch(
    cover: Cover | None, state: State, length: float, random: np.random.Generator
) -> tuple[float, float] | None:
    """Choose the stretch [m] of Sigma_a's x axis to hide (eq. 32); None if nothing is hidden.

    It is relative to the nominal `length` [m] of the beam, so that it reveals nothing about the
    deflection.
    """
    if cover is None or cover.availability >= 1:
        return None
    width = (1 - cover.availability) * length
    middle = {"base": 0.0, "middle": length / 2, "tip": length}.get(cover.place, length / 2)
    if cover.place == "contact" and state.contacts:
        middle = float(state.contact.point[0]) + random.uniform(-1, 1) * MAX_OFFSET * width
    start = float(np.clip(middle - width / 2, 0.0, length - width))
    return start, start + width
