"""How many neighbouring points err together."""

import numpy as np

from solver.instrument.arrays import Floats


def correlation_length(residual: Floats) -> float:
    """Integrated autocorrelation of residuals (n,) in order along the beam; at least 1.

    The centre's error follows the pixel grid, and a nearly row-aligned line crosses it slowly, so
    neighbouring columns err alike: n columns then tell only as much as n over this number. A
    covariance computed for independent errors is too small by this factor. A periodic error is
    made good again half a period later, so the sum runs on past the first zero, tapered
    (Bartlett 1950) to end six times as far out.
    """
    n = len(residual)
    power = np.abs(np.fft.rfft(residual - residual.mean(), 2 * n)) ** 2
    correlation = np.fft.irfft(power)[:n]
    if correlation[0] <= 0:
        return 1.0
    rho = correlation / correlation[0]
    first_zero = int(np.argmax(rho < 0)) or n
    reach = min(6 * first_zero, max(n // 2, 1))
    taper = 1 - np.arange(1, reach) / reach
    return max(1.0, float(1 + 2 * (taper * rho[1:reach]).sum()))
