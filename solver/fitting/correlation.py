"""How many neighbouring points err together."""

import numpy as np

from solver.instrument.arrays import Floats


def correlation_length(residual: Floats) -> float:
    """Integrated autocorrelation (first lobe) of residuals (n,) in order along the beam; >= 1.

    The centre's error follows the pixel grid, and a nearly row-aligned line crosses it slowly, so
    neighbouring columns err alike: n columns then tell only as much as n over this number. A
    covariance computed for independent errors is too small by this factor.
    """
    n = len(residual)
    power = np.abs(np.fft.rfft(residual - residual.mean(), 2 * n)) ** 2
    correlation = np.fft.irfft(power)[:n]
    if correlation[0] <= 0:
        return 1.0
    rho = correlation / correlation[0]
    until = int(np.argmax(rho < 0)) or n
    return max(1.0, float(1 + 2 * rho[1:until].sum()))
