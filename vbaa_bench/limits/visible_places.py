"""Which part of the beam's image is visible: as rendered, or as a scene plans it."""

from collections.abc import Sequence

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.scene_assembler import Pose
from vbaa_bench.limits.image_shape import FRACTIONS


def visible_in_image(hidden_stretches_mm: Sequence[float], length: float) -> Floats:
    """Return the visible fraction (PLACES,) from the truth's column `hidden_stretches_mm`.

    It holds starts and ends in turn; `length` [m] is the beam's nominal length.
    """
    s = FRACTIONS[1:-1] * length / MILLIMETRE
    ends = np.array(hidden_stretches_mm).reshape(-1, 2)
    hidden = (s[:, None] >= ends[:, 0]) & (s[:, None] <= ends[:, 1])
    return np.asarray(1.0 - hidden.any(axis=1))


def visible_by_plan(pose: Pose) -> Floats:
    """Return the visible fraction (PLACES,): all but what the hub and a planned cover hide.

    What the touched object hides is neglected.
    """
    scene, line = pose.experiment.scene, pose.state.centreline
    x = np.interp(FRACTIONS[1:-1] * line[-1, 0], line[:, 0], line[:, 1])
    visible = np.ones(len(x))
    if scene.clamp is None and not any(scene.clamp_offset_mm):
        visible[x < scene.hub.radius_mm * MILLIMETRE] = 0.0
    if pose.hidden is not None:
        visible[(x >= pose.hidden[0]) & (x <= pose.hidden[1])] = 0.0
    return visible
