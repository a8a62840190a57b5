"""Exact beam of a changing section, bowed at rest, under a force with friction: integrated.

The unloaded end does not bend further, so the shape follows from the contact backwards, without
a boundary value problem. In the frame of the force's line, u is the distance from that line along
an axis across the force, P the distance along the force, and psi the beam's angle to the axis.
With sigma the arc length from the contact back to the clamp,

    u' = cos(psi),    P' = sin(psi),    psi' = Q u / w(s)^4 + b(s),    s = s_c - sigma,

Q = F / EI at the clamp; w(s) is the width over that at the clamp, so that EI is proportional to its
fourth power, and b(s) is the curvature at rest (Antman 2005, ch. IV). At the contact psi is
-atan(friction ratio) and the force's line is sin(atan(friction ratio)) times the radius there away:
friction acts on the surface. Where the beam is uniform and straight, without friction, this is the
beam of `exact`.

All lengths are in units of the beam's length. The width is 1 + s (c_0 + c_1 P_1(2 s - 1) + ...)
with Legendre's polynomials P_k: c_0 alone is a cone, whose tip has the width 1 + c_0. The line at
rest is b_0 s^2 + b_1 s^3 + ..., whose second derivative is the curvature at rest. A shape has the
parameters (q, s_c, friction ratio, c_0, c_1, ..., b_0, b_1, ...): q is the force across the beam
over EI.
"""

from typing import Any, Final

import numpy as np

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.beams.curve import END, Curve, U
from solver.beams.stretch import INNER, WIDTHS, Stretch, march, write_contact
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Steps from the contact to the clamp. Measured: for a tip of 0.6 of the clamp's width, bent by
# 40 degrees, the error of the contact is 2e-7; for a uniform beam it is 4e-8. This is no literal,
# and no default value of `steps`: each of these would be compiled anew.
STEPS: Final[Any] = np.int64(16)
FREE_STEPS: Final = 6


@njit
def curve_of(p: Floats, widths: int, radius: float, steps: Any) -> Curve:
    """Integrate the shape with parameters p (k,), of a beam with this radius at the clamp.

    The first `widths` parameters after the friction ratio are those of the width, the others of the
    bow.
    """
    k, bow = len(p), WIDTHS + widths
    free_steps = FREE_STEPS if k > bow else 1
    # The contact has a node on either side: with friction, the curvature jumps there.
    nodes = np.empty((4, free_steps + steps + 2))
    gradients = np.empty((k, 2, free_steps + steps + 2))
    y, by = np.zeros(3), np.zeros((k, 3))
    none, by_none = np.zeros(INNER), np.zeros((k, INNER))
    exists = p[Q] >= 0
    for stretch in (
        Stretch(S_C, -1, END, 0, free_steps, free_steps, -1),
        Stretch(S_C, -1, 0.0, 1, steps, free_steps + 1, 1),
    ):
        exists = exists and write_contact(p, bow, k, radius, y, by)
        by_arm = by[:, 0].copy()
        exists = exists and march(y, by, p, bow, k, stretch, none, by_none, nodes, gradients)
    return Curve(nodes, gradients, free_steps, by_arm, y, by, exists)


@njit
def contact_of(curve: Curve, p: Floats) -> tuple[Floats, Floats]:
    """Compute (F / EI, theta_c, x_c, y_c, s_c, lean) of a curve and its gradients (6, k).

    These are the quantities of `BentBeam`, with the load at the clamp's section.
    """
    k = len(p)
    values, gradients = np.empty(6), np.zeros((6, k))
    square = 1 + p[FRICTION_RATIO] * p[FRICTION_RATIO]
    root = np.sqrt(square)
    lean = -np.arctan(p[FRICTION_RATIO])
    lever, height, angle = curve.base
    cosine, sine = np.cos(angle), np.sin(angle)
    along = lever - curve.nodes[U, curve.contact]
    x_c = along * cosine + height * sine
    y_c = along * sine - height * cosine
    values[0], values[1], values[2] = p[Q] * root, angle - lean, x_c
    values[3], values[4], values[5] = y_c, p[S_C], lean
    gradients[0, Q], gradients[0, FRICTION_RATIO] = root, p[Q] * p[FRICTION_RATIO] / root
    gradients[4, S_C], gradients[5, FRICTION_RATIO] = 1.0, -1 / square
    for i in range(k):
        by_along = curve.by_base[i, 0] - curve.by_arm[i]
        by_height, by_angle = curve.by_base[i, 1], curve.by_base[i, 2]
        gradients[1, i] = by_angle - gradients[5, i]
        gradients[2, i] = by_along * cosine + by_height * sine - y_c * by_angle
        gradients[3, i] = by_along * sine - by_height * cosine + x_c * by_angle
    return values, gradients


@njit
def clamp_moment(curve: Curve, p: Floats) -> tuple[float, Floats]:
    """Compute the moment at the clamp [EI / L] and its gradient (k,) by the shape's parameters."""
    gradient = np.empty(len(curve.by_base))
    root = np.sqrt(1 + p[FRICTION_RATIO] * p[FRICTION_RATIO])
    load, lever = p[Q] * root, curve.base[0]
    for i in range(len(gradient)):
        gradient[i] = load * curve.by_base[i, 0]
    gradient[Q] += root * lever
    gradient[FRICTION_RATIO] += p[Q] * p[FRICTION_RATIO] / root * lever
    return load * lever, gradient


@njit
def bent_beam(p: Floats, widths: int, radius: float, steps: Any) -> Any:
    """Compute the curve of a shape, its contact (6,) and moment with gradients (6, k), (k,)."""
    curve = curve_of(p, widths, radius, steps)
    contact, gradients = contact_of(curve, p)
    moment, by_moment = clamp_moment(curve, p)
    return curve, contact, gradients, moment, by_moment
