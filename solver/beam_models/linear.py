"""Linear beam theory, the paper's eqs. (9) and (10), in Sigma_d."""

import numpy as np

from solver.instrument.arrays import Floats


def unit_deflection(x: Floats | float, x_c: Floats | float) -> Floats:
    """6 EI y / f [m^3] at distance x of a beam pushed at x_c [m]; both broadcast.

    Curved part (9): (3 x_c - x) x^2 up to the contact; linear part (10): (3 x - x_c) x_c^2.
    """
    x, x_c = np.asarray(x, dtype=float), np.asarray(x_c, dtype=float)
    return np.where(x <= x_c, (3 * x_c - x) * x**2, (3 * x - x_c) * x_c**2)
