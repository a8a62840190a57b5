"""Tukey's biweight (Beaton and Tukey 1974) on residuals in sigmas."""

from typing import Final

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.dot_products import FAST

# Residuals from here on have no weight; the efficiency for white noise is 95 %.
CUT: Final = 4.685
VARIANCE_FACTOR: Final = 1 / 0.95
# Median of |x| for a standard normal variable.
MEDIAN: Final = 0.6745


@njit(fastmath=FAST)
def tukey(residual: Floats, cut: float, weight: Floats) -> float:
    """Write weights (n,) to `weight`; return the robust sum of squares, r^2 where r is small."""
    total = 0.0
    for i in range(residual.size):
        kept = max(1 - (residual[i] / cut) ** 2, 0.0)
        weight[i] = kept * kept
        total += 1 - kept * kept * kept
    return total * cut * cut / 3


@njit
def scale(residual: Floats, most: float) -> float:
    """Estimate the factor by which the stated sigmas are too small, from 1 to `most`.

    It is the median of |residual| over its expectation, in steps of 0.05, of the residuals that
    are no outliers at the stated sigmas.
    """
    count = 0
    for r in residual:
        if abs(r) < CUT:
            count += 1
    found = 1.0
    while found < most:
        within = 0
        for r in residual:
            if abs(r) <= MEDIAN * found:
                within += 1
        if 2 * within >= count:
            break
        found += 0.05
    return min(found, most)
