"""Exact uniform beam with two frictionless point contacts, in one plane: integrated.

Beyond the outer contact the beam is straight, so its shape follows from there backwards, without a
boundary value problem. In the frame of the outer contact's tangent, u is the distance back along
that tangent, P the distance from it towards the side of the outer force, and psi the beam's angle
to it. With sigma the arc length from the outer contact back to the clamp,

    u' = cos(psi),    P' = sin(psi),    psi' = q_o u + q_i h,

where q_o and q_i are the two forces over EI, each normal to the beam at its contact, of either
sign; h is the lever arm of the inner force about the point at sigma, and is 0 between the contacts:

    h = (u - u_i) cos(psi_i) + (P - P_i) sin(psi_i)

with (u_i, P_i, psi_i) at the inner contact (Antman 2005, ch. IV). Where one of the forces vanishes
this is the beam of `exact`; where their sum vanishes nothing is singular.

All lengths are in units of the beam's length. A shape has the parameters (q_o, s_o, q_i, s_i), s
being the arc length from the clamp to a contact. This module is compiled.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from solver.beam_models.curve import END, MOST_ANGLE, Curve, U, advance, shifted, write_node
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Parameters of a shape.
Q_OUTER, S_OUTER, Q_INNER, S_INNER = range(4)
PARAMETERS: Final = 4
# Steps on either side of the inner contact. Measured: the error of a contact's place is 1e-8 for a
# beam bent by 40 degrees.
STEPS: Final = 16
# Entries of a contact: force over EI, tangent's angle, x, y, s.
CONTACT: Final = 5


class TwoContacts(NamedTuple):
    """A shape's curve, and (u, P, psi) (3,) at the inner contact with gradients (4, 3).

    The curve's `contact` is the outer one.
    """

    curve: Curve
    inner: Floats
    by_inner: Floats


@njit
def _derivative(
    y: Floats,
    by: Floats,
    p: Floats,
    inner: Floats,
    by_inner: Floats,
    between: bool,
    out: Floats,
    by_out: Floats,
) -> None:
    """Write the derivative by tau of y (u, P, psi) and of its gradients `by` (4, 3).

    tau goes from 0 to 1 `between` the contacts, or from the inner contact to the clamp.
    """
    cosine, sine = np.cos(y[2]), np.sin(y[2])
    curvature, length = p[Q_OUTER] * y[0], p[S_OUTER] - p[S_INNER]
    along, height, arm = 0.0, 0.0, 0.0
    inner_cosine, inner_sine = np.cos(inner[2]), np.sin(inner[2])
    if not between:
        along, height, length = y[0] - inner[0], y[1] - inner[1], p[S_INNER]
        arm = along * inner_cosine + height * inner_sine
        curvature += p[Q_INNER] * arm
    out[0], out[1], out[2] = length * cosine, length * sine, length * curvature
    for i in range(PARAMETERS):
        by_curvature = p[Q_OUTER] * by[i, 0]
        if i == Q_OUTER:
            by_curvature += y[0]
        if not between:
            by_arm = (
                (by[i, 0] - by_inner[i, 0]) * inner_cosine
                + (by[i, 1] - by_inner[i, 1]) * inner_sine
                + (height * inner_cosine - along * inner_sine) * by_inner[i, 2]
            )
            by_curvature += p[Q_INNER] * by_arm
            if i == Q_INNER:
                by_curvature += arm
        by_length = 0.0
        if i == S_INNER:
            by_length = -1.0 if between else 1.0
        elif i == S_OUTER and between:
            by_length = 1.0
        by_out[i, 0] = by_length * cosine - length * sine * by[i, 2]
        by_out[i, 1] = by_length * sine + length * cosine * by[i, 2]
        by_out[i, 2] = by_length * curvature + length * by_curvature


@njit
def _march(
    y: Floats,
    by: Floats,
    p: Floats,
    inner: Floats,
    by_inner: Floats,
    between: bool,
    steps: int,
    first: int,
    nodes: Floats,
    gradients: Floats,
) -> bool:
    """Integrate by the classical method of Runge and Kutta; write the nodes; test the angles."""
    rates, by_rates = np.empty((4, 3)), np.empty((4, PARAMETERS, 3))
    trial, by_trial = np.empty(3), np.empty((PARAMETERS, 3))
    h, length = 1.0 / steps, p[S_INNER]
    if between:
        length = p[S_OUTER] - p[S_INNER]
    for step in range(steps + 1):
        _derivative(y, by, p, inner, by_inner, between, rates[0], by_rates[0])
        if not abs(y[2]) < MOST_ANGLE:
            return False
        write_node(y, by, rates[0, 2] / length, first + step, nodes, gradients)
        if step == steps:
            break
        for stage in range(1, 4):
            part = h if stage == 3 else h / 2
            shifted(y, by, rates[stage - 1], by_rates[stage - 1], part, trial, by_trial)
            _derivative(trial, by_trial, p, inner, by_inner, between, rates[stage], by_rates[stage])
        advance(y, by, rates, by_rates, h)
    return True


@njit
def two_contacts_of(p: Floats, steps: Any = STEPS) -> TwoContacts:
    """Integrate the shape with parameters p (4,), with `steps` on either side of the inner contact.

    The curve has the nodes beyond the tip, at the outer contact, and back to the clamp.
    """
    nodes = np.zeros((4, 2 * steps + 2))
    gradients = np.zeros((PARAMETERS, 2, 2 * steps + 2))
    y, by = np.zeros(3), np.zeros((PARAMETERS, 3))
    inner, by_inner = np.zeros(3), np.zeros((PARAMETERS, 3))
    exists = 0 < p[S_INNER] < p[S_OUTER] < END
    if exists:
        nodes[U, 0] = p[S_OUTER] - END
        exists = _march(y, by, p, inner, by_inner, True, steps, 1, nodes, gradients)
    if exists:
        inner[:], by_inner[:] = y, by
        exists = _march(y, by, p, inner, by_inner, False, steps, steps + 1, nodes, gradients)
    by_arm = np.zeros(PARAMETERS)  # the outer force's line crosses the axis at its contact
    return TwoContacts(Curve(nodes, gradients, 1, by_arm, y, by, exists), inner, by_inner)


@njit
def contacts_of(shape: TwoContacts, p: Floats) -> tuple[Floats, Floats]:
    """Compute both contacts (2, 5), the inner one first, and their gradients (2, 5, 4).

    Each is (force over EI, theta, x, y, s) in the clamp's frame: the force is positive to the side
    of +y, and theta is the angle of the tangent.
    """
    values, gradients = np.empty((2, CONTACT)), np.zeros((2, CONTACT, PARAMETERS))
    base, by_base = shape.curve.base, shape.curve.by_base
    cosine, sine = np.cos(base[2]), np.sin(base[2])
    for j in range(2):
        place, by_place = np.zeros(3), np.zeros((PARAMETERS, 3))
        load, arc = Q_OUTER, S_OUTER
        if j == 0:
            place, by_place = shape.inner, shape.by_inner
            load, arc = Q_INNER, S_INNER
        along, height = base[0] - place[0], base[1] - place[1]
        x, y = along * cosine + height * sine, along * sine - height * cosine
        values[j, 0], values[j, 1], values[j, 4] = p[load], base[2] - place[2], p[arc]
        values[j, 2], values[j, 3] = x, y
        gradients[j, 0, load], gradients[j, 4, arc] = 1.0, 1.0
        for i in range(PARAMETERS):
            by_along, by_height = by_base[i, 0] - by_place[i, 0], by_base[i, 1] - by_place[i, 1]
            gradients[j, 1, i] = by_base[i, 2] - by_place[i, 2]
            gradients[j, 2, i] = by_along * cosine + by_height * sine - y * by_base[i, 2]
            gradients[j, 3, i] = by_along * sine - by_height * cosine + x * by_base[i, 2]
    return values, gradients
