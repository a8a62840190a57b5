"""Compute Tukey's biweight (Beaton and Tukey 1974) on residuals in sigmas."""

import math
from typing import Final

from solver.instrument.arrays import Floats
from solver.instrument.compiled import FAST, njit
from solver.instrument.medians import SIGMA_OVER_MAD, TUKEY_CUT

VARIANCE_FACTOR: Final = 1 / 0.95


def noise_chi2(dof: int) -> float:
    """Compute the largest chi2 per degree of freedom of noise alone: six sigmas of it.

    A run of outliers that has biased a fit of least squares exceeds it.
    """
    return 1 + 6 * math.sqrt(2 / dof)


@njit(fastmath=FAST)
def tukey(residual: Floats, cut: float, weight: Floats) -> float:
    """Write weights (n,) to `weight`; return the robust sum of squares, r^2 where r is small."""
    total = 0.0
    for i in range(residual.size):
        factor = max(1 - (residual[i] / cut) ** 2, 0.0)
        weight[i] = factor * factor
        total += 1 - factor * factor * factor
    return total * cut * cut / 3


@njit
def scale(residual: Floats, max_factor: float) -> float:
    """Estimate the factor by which the stated sigmas are too small, from 1 to `max_factor`.

    It is the median of |residual| over its expectation, in steps of 0.05, of the residuals that
    are no outliers at the stated sigmas.
    """
    count = 0
    for r in residual:
        if abs(r) < TUKEY_CUT:
            count += 1
    factor = 1.0
    while factor < max_factor:
        within = 0
        for r in residual:
            if SIGMA_OVER_MAD * abs(r) <= factor:
                within += 1
        if 2 * within >= count:
            break
        factor += 0.05
    return min(factor, max_factor)
