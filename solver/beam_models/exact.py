"""The exact beam: large deflection, inextensible, frictionless point contact, closed form.

The contact force is normal to the beam and the beam is straight beyond the contact, so in
the frame of the contact's tangent every shape is one rectangular elastica scaled by
lambda = sqrt(EI / F) (Bernoulli; Love 1927, section 263). With u the distance back from the contact
along its tangent, the beam lies at

    P(u) = lambda G(u / lambda),  G(xi) = xi^3 / 6  2F1(1/2, 3/4; 7/4; xi^4 / 4),  P'(u) = tan(phi),

phi being the angle to that tangent, sin(phi) = q u^2 / 2, and q = F / EI = 1 / lambda^2.

The shape is told by (q, lever): q [1/m^2] and the lever arm of the force about the clamp [m].
Both stay regular as the force vanishes, where lambda and the contact angle do not:

    sin(theta_c) = q lever^2 / 2        base moment = F lever
    x_c = lever cos(theta_c) + P(lever) sin(theta_c)
    y_c = lever sin(theta_c) - P(lever) cos(theta_c)
    s_c = lever 2F1(1/2, 1/4; 5/4; (q lever^2 / 2)^2)
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import hyp2f1

from solver.instrument.arrays import Floats


@dataclass(frozen=True)
class Contact:
    """Contact of the shape (q, lever), each with its gradient (2,) by (q, lever).

    theta_c [rad], x_c, y_c, s_c [m].
    """

    theta_c: float
    x_c: float
    y_c: float
    s_c: float
    d_theta_c: Floats
    d_x_c: Floats
    d_y_c: Floats
    d_s_c: Floats


def bend(u: Floats, q: float) -> tuple[Floats, Floats, Floats]:
    """P(u) [m], dP/du = tan(phi) and dP/dq [m^3] at distances u >= 0 [m] back from the contact.

    Needs q u^2 / 2 < 1: the beam has not turned by a right angle.
    """
    sine = q * u**2 / 2
    tangent = sine / np.sqrt(1 - sine**2)
    p = q * u**3 / 6 * hyp2f1(0.5, 0.75, 1.75, sine**2)
    # dP/dq = (u P' - P) / (2 q), with the limit u^3 / 6 where the shape vanishes.
    p_by_q = (u * tangent - p) / (2 * q) if q > 0 else u**3 / 6
    return p, tangent, p_by_q


def contact(q: float, lever: float) -> Contact:
    """Where and at what angle the shape (q, lever) is touched."""
    sine = q * lever**2 / 2
    theta = float(np.arcsin(sine))
    cosine = np.cos(theta)
    p, tangent, p_by_q = (float(v) for v in bend(np.array(lever), q))
    d_theta = np.array([lever**2 / 2, q * lever]) / cosine
    d_p = np.array([p_by_q, tangent])
    d_lever = np.array([0.0, 1.0])
    x_c = lever * cosine + p * sine
    y_c = lever * sine - p * cosine
    stretch = float(hyp2f1(0.5, 0.25, 1.25, sine**2))
    # d/dz z^a 2F1(1/2, a; a + 1; z) = a z^(a-1) (1 - z)^(-1/2) gives, with z = sine^2,
    # ds/dlever at fixed lambda = 1 / cos(theta_c); scaling (s ~ lambda) gives the rest.
    s_c = lever * stretch
    d_s_lever = 1 / cosine
    d_s_q = (lever * d_s_lever - s_c) / (2 * q) if q > 0 else 0.0
    return Contact(
        theta_c=theta,
        x_c=x_c,
        y_c=y_c,
        s_c=s_c,
        d_theta_c=d_theta,
        d_x_c=cosine * d_lever + sine * d_p - y_c * d_theta,
        d_y_c=sine * d_lever - cosine * d_p + x_c * d_theta,
        d_s_c=np.array([d_s_q, d_s_lever]),
    )


def misfit(x: Floats, y: Floats, q: float, lever: float) -> tuple[Floats, Floats, Floats]:
    """Signed misfit (n,) [m] of points from the shape, its gradients by (x, y) and (q, lever).

    The misfit is measured along the contact's normal: eta - P(u), no root finding. Shapes
    (n,), (n, 2), (n, 2).
    """
    at = contact(q, lever)
    sine, cosine = np.sin(at.theta_c), np.cos(at.theta_c)
    base, base_tangent, base_by_q = bend(np.array(lever), q)
    along = x * cosine + y * sine
    across = y * cosine - x * sine
    u = lever - along
    curved = u > 0
    p, tangent, p_by_q = bend(np.where(curved, u, 0.0), q)
    value = base + across - p
    by_point = np.column_stack([-sine + tangent * cosine, cosine + tangent * sine])
    by_theta = -along + tangent * across
    by_q = base_by_q - p_by_q + by_theta * at.d_theta_c[0]
    by_lever = base_tangent - tangent + by_theta * at.d_theta_c[1]
    return value, by_point, np.column_stack([by_q, by_lever])
