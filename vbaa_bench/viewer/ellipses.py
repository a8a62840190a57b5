"""Ellipses that contain two normal errors with a probability of 95 %."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats

# The 95 % quantile of chi-squared with two degrees of freedom is -2 ln(1 - 0.95).
RADIUS: Final = math.sqrt(-2 * math.log(0.05))
_POINTS: Final = 96


def ellipse(sigmas: Sequence[float], correlation: float) -> Floats:
    """Compute a closed line (n, 2) about the origin, of errors with these sigmas."""
    angle = np.linspace(0, 2 * np.pi, _POINTS + 1)
    first, second = np.cos(angle), np.sin(angle)
    other = correlation * first + math.sqrt(1 - correlation**2) * second
    return np.asarray(RADIUS * np.column_stack([sigmas[0] * first, sigmas[1] * other]))
