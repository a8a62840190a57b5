"""Exact beam of a changing section, bowed at rest, under a force with friction: integrated.

The unloaded end does not bend further, so the shape follows from the contact backwards, without
a boundary value problem. In the frame of the force's line, u is the distance from that line along
an axis across the force, P the distance along the force, and psi the beam's angle to the axis.
With sigma the arc length from the contact back to the clamp,

    u' = cos(psi),    P' = sin(psi),    psi' = Q u / w(s)^4 + b(s),    s = s_c - sigma,

Q = F / EI at the clamp; w(s) is the width over that at the clamp, so that EI is proportional to its
fourth power, and b(s) is the curvature at rest (Antman 2005, ch. IV). At the contact psi is
-atan(grip) and the force's line is sin(atan(grip)) times the radius there away: friction acts on
the surface. Where the beam is uniform and straight this is the beam of `frictional`, and without
friction that of `exact`.

All lengths are in units of the beam's length. The width is 1 + s (c_0 + c_1 P_1(2 s - 1) + ...)
with Legendre's polynomials P_k: c_0 alone is a cone, whose tip has the width 1 + c_0. The line at
rest is b_0 s^2 + b_1 s^3 + ..., whose second derivative is the curvature at rest. A shape has the
parameters (q, s_c, grip, c_0, c_1, ..., b_0, b_1, ...): q is the force across the beam over EI, as
in `frictional`.
"""

from typing import Any, Final

import numpy as np

from solver.beam_models.curve import END, MOST_ANGLE, Curve, U, advance, shifted, write_node
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Parameters of a shape before the widths.
Q, S_C, GRIP, WIDTHS = range(4)
# Steps from the contact to the clamp. Measured: for a tip of 0.6 of the clamp's width, bent by
# 40 degrees, the error of the contact is 2e-7; for a uniform beam it is 4e-8.
STEPS: Final = 16
_FREE_STEPS: Final = 6
# Smallest width that a trial may have. Chosen.
LEAST_WIDTH: Final = 0.05


@njit
def width_at(s: float, widths: Floats, terms: Floats) -> tuple[float, float]:
    """Compute the width and its slope at s; write the width's derivative by each term (k,)."""
    t = 2 * s - 1
    before, here = 0.0, 1.0
    slope_before, slope_here = 0.0, 0.0
    width, slope = 1.0, 0.0
    for k in range(len(widths)):
        terms[k] = s * here
        width += widths[k] * terms[k]
        slope += widths[k] * (here + s * slope_here)
        # Legendre's recurrence, and its derivative by s.
        following = ((2 * k + 1) * t * here - k * before) / (k + 1)
        slope_following = ((2 * k + 1) * (t * slope_here + 2 * here) - k * slope_before) / (k + 1)
        before, here = here, following
        slope_before, slope_here = slope_here, slope_following
    return width, slope


@njit
def _bow_at(s: float, bow: Floats, terms: Floats) -> tuple[float, float]:
    """Compute the curvature at rest and its slope at s; write its derivative by each coefficient.

    These are the last of `terms`.
    """
    value, slope, power, power_before = 0.0, 0.0, 1.0, 0.0
    for j in range(len(bow)):
        factor = (j + 2) * (j + 1)
        terms[len(terms) - len(bow) + j] = factor * power
        value += factor * bow[j] * power
        slope += factor * bow[j] * j * power_before
        power_before = power
        power *= s
    return value, slope


@njit
def _derivative(
    tau: float,
    y: Floats,
    by: Floats,
    p: Floats,
    bow: int,
    loaded: bool,
    terms: Floats,
    out: Floats,
    by_out: Floats,
) -> None:
    """Write the derivative by tau of y (u, P, psi) and of its gradients `by` (k, 3).

    tau goes from 0 at the contact to 1 at the clamp or, not loaded, at END. `bow` is the index of
    the bow's first coefficient.
    """
    k = len(p)
    if loaded:
        length, by_length = p[S_C], 1.0
        s, by_s = p[S_C] * (1 - tau), 1 - tau
    else:
        length, by_length = p[S_C] - END, 1.0
        s, by_s = p[S_C] + tau * (END - p[S_C]), 1 - tau
    cosine, sine = np.cos(y[2]), np.sin(y[2])
    rest, rest_slope = _bow_at(s, p[bow:], terms)
    curvature, stiffness, slope = rest, 0.0, rest_slope
    root = np.sqrt(1 + p[GRIP] * p[GRIP])
    soft, load = 0.0, 0.0
    if loaded:
        width, width_slope = width_at(s, p[WIDTHS:bow], terms)
        soft = 1 / max(width, LEAST_WIDTH) ** 4
        load = p[Q] * root
        stiffness = load * soft
        curvature += stiffness * y[0]
        slope -= 4 * stiffness * y[0] / width * width_slope
    out[0], out[1], out[2] = length * cosine, length * sine, length * curvature
    for i in range(k):
        by_curvature = stiffness * by[i, 0]
        if i == Q:
            by_curvature += root * soft * y[0]
        elif i == S_C:
            by_curvature += slope * by_s
        elif i == GRIP:
            by_curvature += p[Q] * p[GRIP] / root * soft * y[0]
        elif i >= bow:
            by_curvature += terms[i - WIDTHS]
        elif loaded:
            by_curvature -= 4 * stiffness * y[0] / width * terms[i - WIDTHS]
        by_out[i, 0] = -length * sine * by[i, 2]
        by_out[i, 1] = length * cosine * by[i, 2]
        by_out[i, 2] = length * by_curvature
    by_out[S_C, 0] += by_length * cosine
    by_out[S_C, 1] += by_length * sine
    by_out[S_C, 2] += by_length * curvature


@njit
def _march(
    y: Floats,
    by: Floats,
    p: Floats,
    bow: int,
    loaded: bool,
    steps: int,
    first: int,
    direction: int,
    nodes: Floats,
    gradients: Floats,
) -> bool:
    """Integrate by the classical method of Runge and Kutta; write the nodes; test the angles."""
    k = len(p)
    terms = np.zeros(k - WIDTHS)
    slopes, by_slopes = np.empty((4, 3)), np.empty((4, k, 3))
    trial, by_trial = np.empty(3), np.empty((k, 3))
    h, length = 1.0 / steps, p[S_C] if loaded else p[S_C] - END
    for step in range(steps + 1):
        _derivative(step * h, y, by, p, bow, loaded, terms, slopes[0], by_slopes[0])
        if not abs(y[2]) < MOST_ANGLE:
            return False
        write_node(y, by, slopes[0, 2] / length, first + direction * step, nodes, gradients)
        if step == steps:
            break
        for stage in range(1, 4):
            part = h if stage == 3 else h / 2
            shifted(y, by, slopes[stage - 1], by_slopes[stage - 1], part, trial, by_trial)
            _derivative(
                step * h + part, trial, by_trial, p, bow, loaded, terms,
                slopes[stage], by_slopes[stage],
            )  # fmt: skip
        advance(y, by, slopes, by_slopes, h)
    return True


@njit
def curve_of(p: Floats, widths: int, radius: float, steps: Any = STEPS) -> Curve:
    """Integrate the shape with parameters p (k,), of a beam with this radius at the clamp.

    The first `widths` parameters after the grip are those of the width, the others of the bow.
    """
    k, bow = len(p), WIDTHS + widths
    free_steps = _FREE_STEPS if k > bow else 1
    # The contact has a node on either side: with friction, the curvature jumps there.
    nodes = np.empty((4, free_steps + steps + 2))
    gradients = np.empty((k, 2, free_steps + steps + 2))
    y, by, by_arm = np.zeros(3), np.zeros((k, 3)), np.zeros(k)
    exists = p[Q] >= 0 and 0 < p[S_C] < END and abs(p[GRIP]) < np.tan(MOST_ANGLE)
    if exists:
        exists = _least_width(p[WIDTHS:bow]) > LEAST_WIDTH
    if exists:
        square = 1 + p[GRIP] * p[GRIP]
        sine = p[GRIP] / np.sqrt(square)
        terms = np.zeros(k - WIDTHS)
        width, slope = width_at(p[S_C], p[WIDTHS:bow], terms)
        by_arm[S_C], by_arm[GRIP] = radius * slope * sine, radius * width / square**1.5
        for i in range(WIDTHS, bow):
            by_arm[i] = radius * terms[i - WIDTHS] * sine
        for loaded in (False, True):
            y[:], by[:] = 0.0, 0.0
            y[0], y[2] = radius * width * sine, -np.arctan(p[GRIP])
            by[:, 0] = by_arm
            by[GRIP, 2] = -1 / square
            direction, count = (1, steps) if loaded else (-1, free_steps)
            first = free_steps + 1 if loaded else free_steps
            exists = exists and _march(
                y, by, p, bow, loaded, count, first, direction, nodes, gradients
            )
    return Curve(nodes, gradients, free_steps, by_arm, y, by, exists)


@njit
def _least_width(widths: Floats) -> float:
    """Compute the smallest width over the beam."""
    terms, least = np.empty(max(len(widths), 1)), 1.0
    for i in range(1, 17):
        width, _ = width_at(i / 16, widths, terms)
        least = min(least, width)
    return least


@njit
def contact_of(curve: Curve, p: Floats) -> tuple[Floats, Floats]:
    """Compute (F / EI, theta_c, x_c, y_c, s_c, lean) of a curve and its gradients (6, k).

    These are the quantities of `frictional.Contact`, with the load at the clamp's section.
    """
    k = len(p)
    values, gradients = np.empty(6), np.zeros((6, k))
    square = 1 + p[GRIP] * p[GRIP]
    root = np.sqrt(square)
    lean = -np.arctan(p[GRIP])
    lever, height, angle = curve.base
    cosine, sine = np.cos(angle), np.sin(angle)
    along = lever - curve.nodes[U, curve.contact]
    x_c = along * cosine + height * sine
    y_c = along * sine - height * cosine
    values[:] = p[Q] * root, angle - lean, x_c, y_c, p[S_C], lean
    gradients[0, Q], gradients[0, GRIP] = root, p[Q] * p[GRIP] / root
    gradients[4, S_C], gradients[5, GRIP] = 1.0, -1 / square
    for i in range(k):
        by_along = curve.by_base[i, 0] - curve.by_arm[i]
        by_height, by_angle = curve.by_base[i, 1], curve.by_base[i, 2]
        gradients[1, i] = by_angle - gradients[5, i]
        gradients[2, i] = by_along * cosine + by_height * sine - y_c * by_angle
        gradients[3, i] = by_along * sine - by_height * cosine + x_c * by_angle
    return values, gradients
