"""How many neighbouring points err together."""

import numpy as np
from numba import njit

from solver.beam_models.exact import FAST
from solver.instrument.arrays import Floats


def correlation_length(residual: Floats) -> float:
    """Integrated autocorrelation of residuals (n,) in order along the beam; at least 1.

    The centre's error follows the pixel grid, and a nearly row-aligned line crosses it slowly, so
    neighbouring columns err alike: n columns then tell only as much as n over this number. A
    covariance computed for independent errors is too small by this factor. A periodic error is
    made good again half a period later, so the sum runs on past the first zero, tapered
    (Bartlett 1950) to end six times as far out.
    """
    return float(integrated_correlation(np.ascontiguousarray(residual, dtype=np.float64)))


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _lagged(centred: Floats, lag: int) -> float:
    total = 0.0
    for i in range(centred.size - lag):
        total += centred[i] * centred[i + lag]
    return total


@njit(cache=True, error_model="numpy")
def integrated_correlation(residual: Floats) -> float:
    """As `correlation_length`, compiled."""
    n = len(residual)
    if n == 0:
        return 1.0
    centred = residual - residual.mean()
    power = _lagged(centred, 0)
    if not power > 0:
        return 1.0
    first_zero = n
    for lag in range(1, n):
        if _lagged(centred, lag) < 0:
            first_zero = lag
            break
    reach = min(6 * first_zero, max(n // 2, 1))
    # The tapered sum of lagged products is that of the squares of sums over `reach` neighbours.
    total, neighbours = 0.0, 0.0
    for i in range(n + reach - 1):
        if i < n:
            neighbours += centred[i]
        if i >= reach:
            neighbours -= centred[i - reach]
        total += neighbours * neighbours
    return max(1.0, total / (reach * power))
