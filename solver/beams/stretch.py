"""A stretch of a bent beam, integrated backwards from a contact: width, bow, moment, steps.

Width, bow, frame and parameters are those of `integrated`. The moment is that of the outer force,
whose line is the axis u = 0, and, on a stretch before two contacts, of an inner force as well. The
inner force acts along a line through (u, P) that is turned by an angle alpha against that axis; its
lever arm about the point (u', P') of the beam is (u' - u) cos(alpha) + (P' - P) sin(alpha).
"""

from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO, OWN, S_C, Q
from solver.beams.curve import END, MOST_ANGLE, advance, shifted, write_node
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# The first parameter of the width.
WIDTHS: Final = OWN
# Smallest width that a trial may have. Chosen.
LEAST_WIDTH: Final = 0.05
# Entries of an inner force: F / EI, u, P, alpha.
LOAD, LINE_U, LINE_P, ALPHA = range(4)
INNER: Final = 4


class Stretch(NamedTuple):
    """A stretch from the arc length p[begin] to p[end], or to `limit` where `end` is negative.

    `loads` is the number of contacts beyond it, 0 to 2. Its `steps` are written to the nodes from
    `first` on, in this `direction`.
    """

    begin: int
    end: int
    limit: float
    loads: int
    steps: int
    first: int
    direction: int


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
def least_width(widths: Floats) -> float:
    """Compute the smallest width over the beam."""
    terms, least = np.empty(max(len(widths), 1)), 1.0
    for i in range(1, 17):
        width, _ = width_at(i / 16, widths, terms)
        least = min(least, width)
    return least


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
def write_contact(p: Floats, bow: int, bow_end: int, radius: float, y: Floats, by: Floats) -> bool:
    """Write state (3,) and gradients (k, 3) at the outer contact; return whether it exists.

    Friction acts on the surface, on the side from which the force comes.
    """
    y[:], by[:] = 0.0, 0.0
    inside = 0 < p[S_C] < END and abs(p[FRICTION_RATIO]) < np.tan(MOST_ANGLE)
    if not inside or least_width(p[WIDTHS:bow]) < LEAST_WIDTH:
        return False
    terms = np.zeros(bow_end - WIDTHS)
    width, slope = width_at(p[S_C], p[WIDTHS:bow], terms)
    square = 1 + p[FRICTION_RATIO] * p[FRICTION_RATIO]
    sided = radius if p[Q] >= 0 else -radius
    sine = p[FRICTION_RATIO] / np.sqrt(square)
    y[0], y[2] = sided * width * sine, -np.arctan(p[FRICTION_RATIO])
    by[S_C, 0], by[FRICTION_RATIO, 0] = sided * slope * sine, sided * width / square**1.5
    for i in range(WIDTHS, bow):
        by[i, 0] = sided * terms[i - WIDTHS] * sine
    by[FRICTION_RATIO, 2] = -1 / square
    return True


@njit(inline="always")  # calls would take half of the time
def moment_at(
    y: Floats, by: Floats, p: Floats, inner: Floats, by_inner: Floats, loads: int, by_moment: Floats
) -> float:
    """Compute the moment over EI at a state y (u, P, psi); write its gradient (k,).

    `inner` (4,) and `by_inner` (k, 4) are the inner force, which acts with two `loads`.
    """
    root = np.sqrt(1 + p[FRICTION_RATIO] * p[FRICTION_RATIO])
    load = p[Q] * root if loads > 0 else 0.0
    moment: float = load * y[0]
    for i in range(len(p)):
        by_moment[i] = load * by[i, 0]
    if loads > 0:
        by_moment[Q] += root * y[0]
        by_moment[FRICTION_RATIO] += p[Q] * p[FRICTION_RATIO] / root * y[0]
    if loads > 1:
        cosine, sine = np.cos(inner[ALPHA]), np.sin(inner[ALPHA])
        along, height = y[0] - inner[LINE_U], y[1] - inner[LINE_P]
        arm = along * cosine + height * sine
        moment += inner[LOAD] * arm
        for i in range(len(p)):
            by_arm = (
                (by[i, 0] - by_inner[i, LINE_U]) * cosine
                + (by[i, 1] - by_inner[i, LINE_P]) * sine
                + (height * cosine - along * sine) * by_inner[i, ALPHA]
            )
            by_moment[i] += inner[LOAD] * by_arm + by_inner[i, LOAD] * arm
    return moment


@njit(inline="always")
def _derivative(
    tau: float,
    y: Floats,
    by: Floats,
    p: Floats,
    bow: int,
    bow_end: int,
    stretch: Stretch,
    inner: Floats,
    by_inner: Floats,
    terms: Floats,
    by_moment: Floats,
    out: Floats,
    by_out: Floats,
) -> None:
    """Write the derivative by tau, from 0 to 1, of y (u, P, psi) and of its gradients `by` (k, 3).

    The bow has the parameters from `bow` to `bow_end`.
    """
    begin, end = stretch.begin, stretch.end
    last = p[end] if end >= 0 else stretch.limit
    length = p[begin] - last
    s = p[begin] - tau * length
    cosine, sine = np.cos(y[2]), np.sin(y[2])
    curvature, slope = _bow_at(s, p[bow:bow_end], terms)
    soft, moment, by_width = 0.0, 0.0, 0.0
    if stretch.loads > 0:
        width, width_slope = width_at(s, p[WIDTHS:bow], terms)
        soft = 1 / max(width, LEAST_WIDTH) ** 4
        moment = moment_at(y, by, p, inner, by_inner, stretch.loads, by_moment)
        by_width = -4 * soft * moment / width
        curvature += soft * moment
        slope += by_width * width_slope
    out[0], out[1], out[2] = length * cosine, length * sine, length * curvature
    for i in range(len(p)):
        by_curvature = soft * by_moment[i]
        if WIDTHS <= i < bow:
            by_curvature += by_width * terms[i - WIDTHS]
        elif bow <= i < bow_end:
            by_curvature += terms[i - WIDTHS]
        by_length = 0.0
        if i == begin:
            by_length = 1.0
            by_curvature += slope * (1 - tau)
        elif i == end:
            by_length = -1.0
            by_curvature += slope * tau
        by_out[i, 0] = by_length * cosine - length * sine * by[i, 2]
        by_out[i, 1] = by_length * sine + length * cosine * by[i, 2]
        by_out[i, 2] = by_length * curvature + length * by_curvature


@njit
def march(
    y: Floats,
    by: Floats,
    p: Floats,
    bow: int,
    bow_end: int,
    stretch: Stretch,
    inner: Floats,
    by_inner: Floats,
    nodes: Floats,
    gradients: Floats,
) -> bool:
    """Integrate by the classical method of Runge and Kutta; write the nodes; test the angles.

    The state y (3,) and its gradients `by` (k, 3) are those at the stretch's begin, and then those
    at its end. Return False where the beam is turned too far.
    """
    k = len(p)
    terms, by_moment = np.zeros(bow_end - WIDTHS), np.zeros(k)
    slopes, by_slopes = np.empty((4, 3)), np.empty((4, k, 3))
    trial, by_trial = np.empty(3), np.empty((k, 3))
    h = 1.0 / stretch.steps
    length = p[stretch.begin] - (p[stretch.end] if stretch.end >= 0 else stretch.limit)
    for step in range(stretch.steps + 1):
        _derivative(
            step * h, y, by, p, bow, bow_end, stretch, inner, by_inner, terms, by_moment,
            slopes[0], by_slopes[0],
        )  # fmt: skip
        if not abs(y[2]) < MOST_ANGLE:
            return False
        column = stretch.first + stretch.direction * step
        write_node(y, by, slopes[0, 2] / length, column, nodes, gradients)
        if step == stretch.steps:
            break
        for stage in range(1, 4):
            part = h if stage == 3 else h / 2
            shifted(y, by, slopes[stage - 1], by_slopes[stage - 1], part, trial, by_trial)
            _derivative(
                step * h + part, trial, by_trial, p, bow, bow_end, stretch, inner, by_inner,
                terms, by_moment, slopes[stage], by_slopes[stage],
            )  # fmt: skip
        advance(y, by, slopes, by_slopes, h)
    return True
