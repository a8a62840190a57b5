"""Linear beam theory, the paper's eqs. (9) and (10), in Sigma_d.

With load = f / (6 EI) [1/m^2] the deflection of a beam pushed at x_c is y = load u(x; x_c):

    curved part (9)     u = (3 x_c - x) x^2       up to the contact
    straight part (10)  u = (3 x - x_c) x_c^2     beyond it

u is twice continuously differentiable, also in x_c and where the two parts meet.
"""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit


def unit_deflection(x: Floats | float, x_c: Floats | float) -> Floats:
    """Compute u = 6 EI y / f [m^3] at distance x of a beam pushed at x_c [m]; both broadcast."""
    x, x_c = np.asarray(x, dtype=float), np.asarray(x_c, dtype=float)
    return np.where(x <= x_c, (3 * x_c - x) * x**2, (3 * x - x_c) * x_c**2)


def unit_slope(x: Floats | float, x_c: Floats | float) -> Floats:
    """Compute du/dx [m^2]."""
    x, x_c = np.asarray(x, dtype=float), np.asarray(x_c, dtype=float)
    return np.where(x <= x_c, (6 * x_c - 3 * x) * x, 3 * x_c**2)


def unit_deflection_by_contact(x: Floats | float, x_c: Floats | float) -> Floats:
    """Compute du/dx_c [m^2]."""
    x, x_c = np.asarray(x, dtype=float), np.asarray(x_c, dtype=float)
    return np.where(x <= x_c, 3 * x**2, (6 * x - 3 * x_c) * x_c)


@njit
def ratio_slope(x1: float, x2: float, x_c: float) -> float:
    """Compute d rho / d x_c [1/m] of rho = y2 / y1 at points 0 < x1 < x2 [m]; it is positive.

    rho rises from x2/x1 to (x2/x1)^2.
    """
    if x2 <= x_c:
        return 3 * (x2 - x1) / (3 * x_c - x1) ** 2 * (x2 / x1) ** 2
    if x1 >= x_c:
        return 3 * (x2 - x1) / (3 * x1 - x_c) ** 2
    below = (3 * x_c - x1) * x1**2
    above = (3 * x2 - x_c) * x_c**2
    return (3 * x_c * (2 * x2 - x_c) - 3 * x1**2 * above / below) / below


@njit
def contact_of_pair(x1: float, y1: float, x2: float, y2: float, guess: float) -> float:
    """Solve rho(x_c) = y2 / y1 for the contact x_c [m] of two points 0 < x1 < x2, 0 < y1.

    Returns 0 at or below rho = x2/x1, where the contact tends to the clamp, and infinity at or
    above its square, where it tends to infinity: for such points linear theory has no contact. In
    between, the three cases of section V-A are three intervals of rho:

        both on the curved part (15)    (x1 + (x2 - x1) q1 / (q1 - q2)) / 3 with q = y / x^2
        both on the straight part (19)  3 (x1 - y1 / m) with m = (y2 - y1) / (x2 - x1)
        one on each (20)                the root of a cubic in [x1, x2]

    The first two are (15) and (19), rewritten without cancellation. For the cubic, Newton's steps
    from `guess` (or from the middle) are kept inside a bracket that shrinks around the root.
    """
    rho, r = y2 / y1, x2 / x1
    # Allow for rounding: points on a straight line through the clamp have no contact at 1e-17 m.
    if rho <= r * (1 + 1e-14):
        return 0.0
    if rho >= r * r * (1 - 1e-14):
        return np.inf
    if 2 * x1 * rho <= 3 * x2 - x1:
        return 3 * (x1 - y1 * (x2 - x1) / (y2 - y1))
    if (3 * x2 - x1) * x1**2 * rho >= 2 * x2**3:
        q1, q2 = y1 / x1**2, y2 / x2**2
        if q1 <= q2:  # infinite except for rounding
            return np.inf
        return (x1 + (x2 - x1) * q1 / (q1 - q2)) / 3
    low, high = x1, x2
    c = guess if x1 < guess < x2 else (x1 + x2) / 2
    linear, constant = 3 * x1**2 * rho, x1**3 * rho
    for _ in range(60):
        value = ((c - 3 * x2) * c + linear) * c - constant
        if value > 0:  # g_cl falls from g_cl(x1) >= 0 to g_cl(x2) <= 0, (23) and (24)
            low = c
        else:
            high = c
        slope = (3 * c - 6 * x2) * c + linear
        next_c = c - value / slope if slope != 0 else low
        if not low < next_c < high:
            next_c = (low + high) / 2
        if abs(next_c - c) <= 1e-14 * x2:
            return next_c
        c = next_c
    return c
