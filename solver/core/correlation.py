"""Compute the correlation length of the errors of neighbouring points: of a line, or of a field."""

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


def field_correlation(field: Floats, axis: int, *, tapered: bool = False) -> float:
    """Compute the integrated autocorrelation of a field of residuals along an axis; at least 1.

    It sums the autocorrelation of all lines along the axis together, each of which may be too short
    for `correlation_length`, up to where it falls to zero; the field's mean is taken to be zero.
    NaN marks gaps, and each lag averages the pairs that it has. With `tapered` each lag is weighted
    by its share of pairs instead, and the lags end at half the axis: for fields without gaps whose
    lines have an error in common, so that their autocorrelation does not fall to zero.
    """
    lines = np.moveaxis(field, axis, 0)
    known = np.isfinite(lines)
    lines = np.where(known, lines, 0.0)
    size, total = len(lines), 1.0
    power = max(float(np.sum(lines**2)), 1e-300)
    for lag in range(1, size // 2 if tapered else size):
        pairs = known.sum() if tapered else max((known[lag:] & known[:-lag]).sum(), 1)
        products = float(np.sum(lines[lag:] * lines[:-lag])) * float(known.sum() / pairs)
        if products <= 0:
            break
        total += 2 * products / power
    return total
