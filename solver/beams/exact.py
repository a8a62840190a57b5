"""Exact beam: large deflection, inextensible, frictionless point contact, closed form.

The contact force is normal to the beam and the beam is straight beyond the contact, so in
the frame of the contact's tangent every shape is one rectangular elastica scaled by
lambda = sqrt(EI / F) (Bernoulli; Love 1927, section 263). With u the distance back from the contact
along its tangent, the distance of the beam from the tangent is

    P(u) = lambda G(u / lambda),  G(xi) = xi^3 / 6  2F1(1/2, 3/4; 7/4; xi^4 / 4),  P'(u) = tan(phi),

phi being the angle to that tangent, sin(phi) = q u^2 / 2, and q = F / EI = 1 / lambda^2.

The shape has two parameters: q [1/m^2] and lever, the lever arm of the force about the clamp [m].
Both stay regular as the force vanishes, where lambda and the contact angle do not:

    sin(theta_c) = q lever^2 / 2        base moment = F lever
    x_c = lever cos(theta_c) + P(lever) sin(theta_c)
    y_c = lever sin(theta_c) - P(lever) cos(theta_c)
    s_c = lever 2F1(1/2, 1/4; 5/4; (q lever^2 / 2)^2)

Both hypergeometric functions of sin^2(phi) are analytic in 1 - cos(phi), with the nearest
singularity at 2, so a Chebyshev interpolant of low degree gives them to double precision.
"""

from typing import Any, Final

import numpy as np
from numpy.polynomial import chebyshev, polynomial
from scipy.special import hyp2f1

from solver.instrument.compiled import njit

# The shorter series is valid up to this angle from the contact's tangent: cos(phi) > 0.9, 25.8 deg.
GENTLE: Final = 0.1
STEEP: Final = 1.0
GENTLE_SINE: Final = 0.4358
# Largest sine of the turn at the contact; beyond it points behind the clamp are not followed.
MOST_SINE: Final = 0.995


def _series(a: float, max_versine: float, degree: int) -> tuple[float, ...]:
    """Expand 2F1(1/2, a; a + 1; sin^2 phi) as a polynomial in t, from the constant upwards.

    t is 2 (1 - cos(phi)) / `max_versine` - 1, for a versine 1 - cos(phi) from 0 to `max_versine`.
    In t, whose singularities are outside the unit circle, powers are as well conditioned as
    Chebyshev's polynomials.
    """

    nodes = chebyshev.chebpts1(degree + 1)
    values = hyp2f1(0.5, a, a + 1, 1 - (1 - max_versine * (nodes + 1) / 2) ** 2)
    coefficients = chebyshev.cheb2poly(chebyshev.chebfit(nodes, values, degree))
    coefficients[0] += 1 - polynomial.polyval(
        -1.0, coefficients
    )  # a straight beam, to the last bit
    return tuple(float(c) for c in coefficients)


# Coefficients decrease by 1/5.8 (steep) and 1/78 (gentle) from one to the next.
BEND_STEEP: Final = _series(0.75, STEEP, 20)
BEND_GENTLE: Final = _series(0.75, GENTLE, 8)
_ARC_LENGTH: Final = _series(0.25, STEEP, 20)


@njit(inline="always")
def horner(t: float, series: tuple[float, ...]) -> float:
    """Evaluate the polynomial with coefficients `series`, from the constant upwards, at t.

    Even and odd powers are separate: two short loops are unrolled and run in parallel.
    """
    square = t * t
    even, odd = 0.0, 0.0
    for i in range((len(series) + 1) // 2):
        even = even * square + series[(len(series) - 1) // 2 * 2 - 2 * i]
    for i in range(len(series) // 2):
        odd = odd * square + series[len(series) // 2 * 2 - 1 - 2 * i]
    return even + t * odd


@njit
def bend_at(u: float, q: float) -> tuple[float, float, float]:
    """Compute P(u), dP/du and dP/dq at a distance u >= 0 with q u^2 / 2 < 1."""
    sine = q * u * u / 2
    cosine = np.sqrt(1 - sine * sine)
    shape = horner(1 - 2 * cosine, BEND_STEEP)
    return u * sine / 3 * shape, sine / cosine, u**3 / 12 * (3 / cosine - shape)


@njit
def contact_at(q: float, lever: float) -> Any:
    """Compute (theta_c, x_c, y_c, s_c), each as (value, d/dq, d/dlever)."""
    sine = q * lever * lever / 2
    cosine = np.sqrt(1 - sine * sine)
    theta_q, theta_l = lever * lever / 2 / cosine, q * lever / cosine
    p, tangent, p_by_q = bend_at(lever, q)
    x_c = lever * cosine + p * sine
    y_c = lever * sine - p * cosine
    # d/dz z^a 2F1(1/2, a; a + 1; z) = a z^(a-1) (1 - z)^(-1/2) gives, with z = sine^2,
    # ds/dlever at fixed lambda = 1 / cos(theta_c); scaling (s ~ lambda) gives the rest.
    s_c = lever * horner(1 - 2 * cosine, _ARC_LENGTH)
    s_by_q = (lever / cosine - s_c) / (2 * q) if q > 0 else 0.0
    return (
        (np.arcsin(sine), theta_q, theta_l),
        (x_c, sine * p_by_q - y_c * theta_q, cosine + sine * tangent - y_c * theta_l),
        (y_c, -cosine * p_by_q + x_c * theta_q, sine - cosine * tangent + x_c * theta_l),
        (s_c, s_by_q, 1 / cosine),
    )
