"""Correction for a beam that hangs below plane C by its own weight."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.rig import Rig

# Relative sigma of the sag: bent aside, the beam hangs a little less than straight.
RELATIVE_SIGMA = 0.02


def correct_for_sag(points: Floats, viewpoint: Floats, rig: Rig) -> Floats:
    """Move points (n, 2) [m] of a sagging beam to their positions for a beam in C.

    `points` are where the rays from `viewpoint` (4,), homogeneous, to the sagging beam meet C, in
    Sigma_a. At arc length s a cantilever hangs by sag (s^4 - 4 L s^3 + 6 L^2 s^2) / (3 L^4) under
    its weight (Euler and Bernoulli). The chord from the clamp approximates the arc.
    """
    if rig.sag == 0:
        return points
    *centre, height, w = viewpoint
    corrected = points
    for _ in range(2):
        chord = np.hypot(*(corrected - rig.base_position[:2]).T) / rig.beam.length
        depth = rig.sag * chord**2 * (chord**2 - 4 * chord + 6) / 3
        # The ray from V through the point on C meets the beam below it.
        corrected = points - (depth / height)[:, None] * (np.array(centre) - w * points)
    return np.asarray(corrected)


def scale_error(viewpoint: Floats, rig: Rig) -> float:
    """Compute the relative sigma of lengths that results from the sag's uncertainty."""
    return float(RELATIVE_SIGMA * abs(rig.sag * viewpoint[3] / viewpoint[2]))
