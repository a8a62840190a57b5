"""Which part of the beam's image is visible: as rendered, or as a scene plans it."""

from collections.abc import Sequence

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.limits.imaged_beam import FRACTIONS


def visible_in_image(pose: Pose, hidden_stretches_mm: Sequence[float]) -> Floats:
    """Return the visible fraction (PLACES,) from the truth's column `hidden_stretches_mm`.

    It holds starts and ends in turn. A stretch that is declared as missing is visible in the image,
    but no method may use it.
    """
    s = FRACTIONS[1:-1] * pose.experiment.scene.beam.length_mm
    ends = np.array(hidden_stretches_mm).reshape(-1, 2)
    hidden = ((s[:, None] >= ends[:, 0]) & (s[:, None] <= ends[:, 1])).any(axis=1)
    cover = pose.spec.cover
    if cover is not None and not cover.in_image:
        hidden |= _covered(pose)
    return np.asarray(1.0 - hidden)


def visible_by_plan(pose: Pose) -> Floats:
    """Return the visible fraction (PLACES,): all but what the hub and a planned cover hide.

    What the touched object hides is neglected.
    """
    scene, hidden = pose.experiment.scene, _covered(pose)
    if scene.clamp is None and not any(scene.clamp_offset_mm):
        hidden |= _x(pose) < scene.hub.radius_mm * MILLIMETRE
    return np.asarray(1.0 - hidden)


def _covered(pose: Pose) -> Mask:
    """Mark the places (PLACES,) that the frame's cover hides."""
    start, end = pose.hidden or (np.inf, np.inf)
    x = _x(pose)
    return np.asarray((x >= start) & (x <= end))


def _x(pose: Pose) -> Floats:
    """Interpolate x (PLACES,) [m] of the beam in the clamp's frame."""
    length = pose.state.centreline[-1, 0]
    return pose.state.points_at(FRACTIONS[1:-1] * length)[:, 0]
