"""How finely a bent tube must be meshed to be told from a smooth one by no more than a tolerance.

A chord leaves an arc of curvature kappa by kappa h^2 / 8 in its middle, h being its length; a
regular polygon of n corners leaves its circle by r (1 - cos(pi / n)).
"""

import math

import numpy as np

from solver.instrument.arrays import Floats


def facets(radius: float, tolerance: float) -> int:
    """Sides of a polygon that leaves a circle by no more than the tolerance; a multiple of four,
    so that it is symmetric about both axes. Both lengths in one unit."""
    return 4 * math.ceil(math.pi / math.acos(max(1 - tolerance / radius, 0.0)) / 4)


def ring_count(length: float, sharpest: float, tolerance: float) -> int:
    """Rings that suffice for every beam of `length` whose curvature falls evenly from `sharpest`
    at the clamp to none at the tip: those of a chord's length sqrt(8 tolerance / kappa)."""
    # The integral of sqrt(kappa) is two thirds of its value at the clamp.
    chords = 2 / 3 * length * math.sqrt(sharpest / (8 * tolerance))
    # Two in three lie as curvature asks, the others evenly.
    return max(math.ceil(1.5 * chords) + 1, 16)


def rings(s: Floats, points: Floats, count: int) -> Floats:
    """Arc lengths (count,) where rings stand on a curve: points (n, 3) at arc lengths `s` (n,).

    Two in three stand close where the curve is sharp, as the square root of its curvature, the
    others evenly.
    """
    tangents = np.diff(points, axis=0) / np.diff(s)[:, None]
    turned = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
    middle = (s[2:] - s[:-2]) / 2
    density = np.sqrt(turned / middle)
    asked = np.concatenate(
        [[0.0], np.cumsum(np.interp((s[1:] + s[:-1]) / 2, s[1:-1], density) * np.diff(s))]
    )
    even = (s - s[0]) / (s[-1] - s[0])
    # A straight beam asks nowhere.
    share = asked / asked[-1] if asked[-1] > 1e-9 else even
    return np.interp(np.linspace(0, 1, count), (2 * share + even) / 3, s)
