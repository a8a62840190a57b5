"""Mesh density at which a bent tube differs from the smooth one by no more than a tolerance.

The middle of a chord of length h is kappa h^2 / 8 from its arc of curvature kappa; a regular
polygon of n corners is up to r (1 - cos(pi / n)) from its circle.
"""

import math

import numpy as np

from solver.instrument.arrays import Floats


def facets(radius: float, tolerance: float) -> int:
    """Compute the number of sides of a polygon within the tolerance of its circle.

    It is a multiple of four, so that the polygon is symmetric about both axes. Both lengths are
    in one unit.
    """
    return 4 * math.ceil(math.pi / math.acos(max(1 - tolerance / radius, 0.0)) / 4)


def ring_count(length: float, sharpest: float, tolerance: float) -> int:
    """Compute the number of rings for chords of length sqrt(8 tolerance / kappa).

    It suffices for every beam of `length` whose curvature falls linearly from `sharpest` at the
    clamp to zero at the tip.
    """
    # The integral of sqrt(kappa) is two thirds of its value at the clamp.
    chords = 2 / 3 * length * math.sqrt(sharpest / (8 * tolerance))
    # Two in three rings are spaced by curvature, the others evenly.
    return max(math.ceil(1.5 * chords) + 1, 16)


def rings(s: Floats, points: Floats, count: int) -> Floats:
    """Compute arc lengths (count,) of rings on a curve: points (n, 3) at arc lengths `s` (n,).

    The density of two in three is proportional to the square root of the curvature; the others
    are evenly spaced.
    """
    tangents = np.diff(points, axis=0) / np.diff(s)[:, None]
    angles = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
    spacing = (s[2:] - s[:-2]) / 2
    density = np.sqrt(angles / spacing)
    integral = np.concatenate(
        [[0.0], np.cumsum(np.interp((s[1:] + s[:-1]) / 2, s[1:-1], density) * np.diff(s))]
    )
    even = (s - s[0]) / (s[-1] - s[0])
    # On a straight beam all rings are evenly spaced.
    fraction = integral / integral[-1] if integral[-1] > 1e-9 else even
    return np.interp(np.linspace(0, 1, count), (2 * fraction + even) / 3, s)
