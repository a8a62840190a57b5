"""Compute the correlation length of the errors of neighbouring points."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import FAST, njit
from solver.instrument.small_matrices import dot


def correlation_length(residual: Floats) -> float:
    """Compute the integrated autocorrelation of residuals (n,), ordered along the beam; at least 1.

    The error of the centreline follows the pixel grid, and a nearly row-aligned line crosses the
    grid slowly, so neighbouring columns have similar errors: n columns have the information of n
    over this number independent columns. A covariance computed for independent errors is too small
    by this factor. A periodic error cancels half a period later, so the sum continues beyond the
    first zero, with a taper (Bartlett 1950) that ends at six times its lag.
    """
    return float(integrated_correlation(np.ascontiguousarray(residual, dtype=np.float64)))


@njit(fastmath=FAST)
def integrated_correlation(residual: Floats) -> float:
    """Compute `correlation_length` in compiled code."""
    n = residual.size
    total = 0.0
    for i in range(n):
        total += residual[i]
    centred = residual - total / n
    power = dot(centred, centred)
    if not power > 0:
        return 1.0
    first_zero = 1
    while first_zero < n and dot(centred[first_zero:], centred) >= 0:
        first_zero += 1
    window = min(6 * first_zero, max(n // 2, 1))
    # The tapered sum of lagged products equals the sum of squared sums over `window` neighbours.
    cumulative = np.zeros(n + 2 * window)
    total = 0.0
    for i in range(n + window):
        total += centred[i] if i < n else 0.0
        cumulative[window + i] = total
    total = 0.0
    for i in range(n + window):
        total += (cumulative[window + i] - cumulative[i]) ** 2
    return max(1.0, total / (window * power))
