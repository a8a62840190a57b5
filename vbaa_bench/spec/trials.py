"""Scene -> trials: every push with its opaque name and its own random numbers."""

import hashlib
import itertools
from dataclasses import dataclass

import numpy as np

from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.spec.scene import Scene


@dataclass(frozen=True)
class Push:
    """First contact at `contact_distance` [m], then on until y_tip / L is `deflection` or the
    motor has turned by `pushing_angle` [rad]; one of the two is None."""

    contact_distance: float
    deflection: float | None
    pushing_angle: float | None

    def __str__(self) -> str:
        """How far it is pushed, as a plot's legend says it."""
        if self.deflection is not None:
            return f"{self.deflection / PERCENT:.6g} %"
        return f"{(self.pushing_angle or 0.0) / DEGREE:.6g}°"


@dataclass(frozen=True)
class Trial:
    """One frame to be made. `index` counts the grid of the scene, `frame_id` tells nothing."""

    index: int
    frame_id: str
    repeat: int
    push: Push


def trials(scene: Scene) -> list[Trial]:
    """All trials of a scene, in the order of their opaque names, which is that of the files."""
    pushes = scene.pushes
    ends: list[tuple[float | None, float | None]] = [
        (percent * PERCENT, None) for percent in pushes.deflection_pct or ()
    ]
    ends += [(None, degrees * DEGREE) for degrees in pushes.pushing_angle_deg or ()]
    grid = itertools.product(pushes.contact_distance_mm, ends, range(pushes.repeats))
    identity = scene.model_dump_json()
    made = [
        Trial(i, _frame_id(identity, i), repeat, Push(distance * MILLIMETRE, *end))
        for i, (distance, end, repeat) in enumerate(grid)
    ]
    return sorted(made, key=lambda trial: trial.frame_id)


def random_generator(scene: Scene, stage: str, trial: int = 0) -> np.random.Generator:
    """The generator of one stage of one trial: the same whatever else is made, and by whom."""
    return np.random.default_rng([scene.seed, trial, int.from_bytes(_digest(stage)[:8])])


def render_seed(scene: Scene, stage: str, trial: int = 0) -> int:
    """A 32-bit seed for the renderer, from the same derivation."""
    return int(random_generator(scene, stage, trial).integers(2**32))


def _frame_id(identity: str, index: int) -> str:
    return _digest(f"frame {identity} {index}")[:8].hex()


def _digest(text: str) -> bytes:
    return hashlib.blake2b(text.encode("utf-8")).digest()
