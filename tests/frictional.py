"""Exact uniform beam under a force inclined against its normal by friction, in closed form.

Tests compare the integrated beam with it.

The friction ratio m is the force's component along the beam over that across it, positive towards
the tip; the force is inclined by -atan(m). With u the distance back from the force's line, along an
axis across the force, the curvature is Q u, Q = F / EI, as without friction. The angle psi of the
beam to that axis and the distance P from it, and the arc length S, are (Love 1927, section 263)

    sin(psi) = a + Q u^2 / 2,  a = -m / sqrt(1 + m^2),  P' = tan(psi),  S' = 1 / cos(psi),

and in Carlson's symmetric elliptic integrals, which stay regular as the force vanishes (Carlson
1988; DLMF 19.29), with t = Q u^2 / 2 and c^2 = 1 - a^2,

    S = u / c R_F(1 - t / (1 - a), 1 + t / (1 + a), 1),
    P = a S + u t / (3 c) R_D(1 - t / (1 - a), 1 + t / (1 + a), 1).

A shape has the parameters (q, lever, friction ratio): q = c Q is the force across the beam over EI
[1/m^2], which a friction ratio changes least, and lever is the lever arm of the force about the
clamp [m]. Without friction this is the beam of `exact`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import elliprd, elliprf

from solver.beams.exact import MOST_SINE
from solver.instrument.arrays import Floats

Real = Floats | float
# Below this turn the gradients by q use series: the closed forms are differences over q.
_GENTLE: Final = 1e-5


@dataclass(frozen=True)
class Contact:
    """Contacts of shapes, each quantity with its gradient (3, ...) by (q, lever, friction ratio).

    `load` is F / EI [1/m^2]; `theta_c` is the tangent's angle [rad], `lean` the angle from the
    normal to the force, back to the clamp [rad]; `x_c`, `y_c`, `s_c` are in [m].
    """

    load: Floats
    theta_c: Floats
    lean: Floats
    x_c: Floats
    y_c: Floats
    s_c: Floats
    d_load: Floats
    d_theta_c: Floats
    d_lean: Floats
    d_x_c: Floats
    d_y_c: Floats
    d_s_c: Floats


@dataclass(frozen=True)
class _Curve:
    """P and S at distances u, tan(psi), 1 / cos(psi), gradients (2, n) by (q, friction ratio)."""

    p: Floats
    s: Floats
    tangent: Floats
    secant: Floats
    d_p: Floats
    d_s: Floats


def exists(q: Real, lever: Real, friction_ratio: Real) -> bool:
    """Test whether beams can have these shapes: pushed, and turned by less than a right angle."""
    sine = _sine(lever, q, friction_ratio)
    return bool(np.all(np.greater_equal(q, 0) & np.greater(lever, 0) & (sine < MOST_SINE)))


def contact(q: Real, lever: Real, friction_ratio: Real = 0.0, radius: float = 0.0) -> Contact:
    """Compute position and angle of the contacts of shapes, on a beam of this radius [m].

    Friction acts on the beam's surface: the force's line crosses the centreline by radius times
    friction ratio beyond the contact.
    """
    q, lever, friction_ratio = (
        np.asarray(value, dtype=float) for value in (q, lever, friction_ratio)
    )
    zero, one = np.zeros_like(lever), np.ones_like(lever)
    by_lever, by_friction_ratio = np.array([zero, one, zero]), np.array([zero, zero, one])
    sine, cosine, d_across = _axis(q, lever, friction_ratio)
    curve = _curve(lever, q, friction_ratio)
    p, d_p = curve.p, np.array([curve.d_p[0], curve.tangent, curve.d_p[1]])
    d_s = np.array([curve.d_s[0], curve.secant, curve.d_s[1]])
    x, y = lever * cosine + p * sine, lever * sine - p * cosine
    d_x = cosine * by_lever + sine * d_p - y * d_across
    d_y = sine * by_lever - cosine * d_p + x * d_across
    lean, d_lean = -np.arctan(friction_ratio), -by_friction_ratio / (1 + friction_ratio**2)
    theta_c, d_theta = np.arcsin(sine) - lean, d_across - d_lean
    shortening, d_shortening = radius * friction_ratio, radius * by_friction_ratio
    theta_sine, theta_cosine = np.sin(theta_c), np.cos(theta_c)
    root = np.hypot(1, friction_ratio)
    return Contact(
        load=q * root,
        theta_c=theta_c,
        lean=lean,
        x_c=x - shortening * theta_cosine,
        y_c=y - shortening * theta_sine,
        s_c=curve.s - shortening,
        d_load=np.array([root, zero, q * friction_ratio / root]),
        d_theta_c=d_theta,
        d_lean=d_lean,
        d_x_c=d_x - theta_cosine * d_shortening + shortening * theta_sine * d_theta,
        d_y_c=d_y - theta_sine * d_shortening - shortening * theta_cosine * d_theta,
        d_s_c=d_s - d_shortening,
    )


def misfit(
    x: Floats, y: Floats, q: float, lever: float, friction_ratio: float = 0.0
) -> tuple[Floats, Floats, Floats]:
    """Compute signed misfits (n,) [m] of points, gradients (n, 2) by (x, y), (n, 3) by the shape.

    The misfit is measured along the force, without root finding. A point farther behind the clamp
    than the curve's end is measured from that end.
    """
    sine, cosine, d_across = _axis(q, lever, friction_ratio)
    base = _curve(lever, q, friction_ratio)
    along, across = x * cosine + y * sine, y * cosine - x * sine
    u = np.minimum(lever - along, farthest(q, friction_ratio))
    clipped = np.maximum(u, 0.0)
    curve = _curve(clipped, q, friction_ratio)
    value = base.p + across - curve.p + friction_ratio * (u - clipped)
    by_point = np.column_stack([curve.tangent * cosine - sine, cosine + curve.tangent * sine])
    by_angle = curve.tangent * across - along
    by_shape = np.column_stack(
        [
            base.d_p[0] - curve.d_p[0] + by_angle * d_across[0],
            base.tangent - curve.tangent + by_angle * d_across[1],
            base.d_p[1] - curve.d_p[1] + (u - clipped) + by_angle * d_across[2],
        ]
    )
    return value, by_point, by_shape


def farthest(q: Real, friction_ratio: Real) -> Floats:
    """Compute the distance back from the force's line [m] of a turn by almost a right angle."""
    root = np.hypot(1, friction_ratio)
    return np.asarray(
        np.sqrt(2 * (MOST_SINE + friction_ratio / root) / np.maximum(q * root, 1e-300))
    )


def _sine(u: Real, q: Real, friction_ratio: Real) -> Floats:
    """Compute sin(psi) at distances u >= 0 [m] back from the force's line; all broadcast."""
    root = np.hypot(1, friction_ratio)
    return np.asarray(q * root * np.square(u) / 2 - friction_ratio / root)


def _axis(q: Real, lever: Real, friction_ratio: Real) -> tuple[Floats, Floats, Floats]:
    """Compute sine, cosine and gradient (3, ...) of the angle of the axis across the force."""
    root = np.hypot(1, friction_ratio)
    sine = _sine(lever, q, friction_ratio)
    cosine = np.sqrt(1 - sine**2)
    by_load = np.square(lever) / 2
    by_q, by_lever = root * by_load, q * root * np.asarray(lever)
    by_friction_ratio = q * friction_ratio / root * by_load - 1 / root**3
    return sine, cosine, np.array([by_q / cosine, by_lever / cosine, by_friction_ratio / cosine])


def _curve(u: Real, q: Real, friction_ratio: Real) -> _Curve:
    """Compute the curve at distances u >= 0 [m] back from the force's line; all broadcast."""
    root = np.hypot(1, friction_ratio)
    c, a, load = 1 / root, -friction_ratio / root, q * root
    turn = np.asarray(load * np.square(u) / 2)
    sine = a + turn
    secant = 1 / np.sqrt(1 - sine**2)
    low, high = 1 - turn / (1 - a), 1 + turn / (1 + a)
    s = u / c * elliprf(low, high, 1.0)
    p = a * s + u * turn / (3 * c) * elliprd(low, high, 1.0)
    # dP/da and dS/da are integrals of 1 / cos^3(psi) and sin(psi) / cos^3(psi).
    d_p_a = (u * (1 + a * sine) * secant + s - a * p) / (2 * c**2)
    d_s_a = (u * (a + sine) * secant + a * s - p) / (2 * c**2)
    # By similarity, u dP/du - 2 Q dP/dQ = P, and so for S.
    gentle = turn < _GENTLE
    twice = np.where(gentle, 1.0, 2 * load)
    cubed, fifth = (u / c) ** 3 / 6, load * (u / c) ** 5 / 20
    d_p_load = np.where(gentle, cubed + 3 * a * fifth, (u * sine * secant - p) / twice)
    d_s_load = np.where(gentle, a * cubed + (1 + 2 * a**2) * fifth, (u * secant - s) / twice)
    return _Curve(
        p=p,
        s=s,
        tangent=sine * secant,
        secant=secant,
        d_p=np.array([root * d_p_load, q * friction_ratio / root * d_p_load - d_p_a / root**3]),
        d_s=np.array([root * d_s_load, q * friction_ratio / root * d_s_load - d_s_a / root**3]),
    )
