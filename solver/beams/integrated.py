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

A step of a fit follows the curved valley of its objective: load and place of a contact can change a
lot together with taper, friction, bow and clamp, while the beam beyond the contact stays where it
is, as the points there require. A step of all parameters is therefore straight in the angle of that
end and in its distance from the clamp; load and place follow from these. So does an inclination of
the plane: to first order an image shows the deflection times cos(psi) - (y_v / z_v) sin(psi).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from solver.beams.beam import (
    CONTACT,
    FRICTION_RATIO,
    OWN,
    PSI,
    S_C,
    SOFTNESS,
    BentBeam,
    Prior,
    Q,
    Radius,
)
from solver.beams.curve import END, Curve, U
from solver.beams.stretch import INNER, WIDTHS, Stretch, march, width_at, write_contact
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Steps from the contact to the clamp. Measured: for a tip of 0.6 of the clamp's width, bent by
# 40 degrees, the error of the contact is 2e-7; for a uniform beam it is 4e-8. This is no literal,
# and no default value of `steps`: each of these would be compiled anew.
STEPS: Final[Any] = np.int64(16)
FREE_STEPS: Final = 6
# Newton's method: most iterations, relative change at its end, and largest relative change in one
# of them. Chosen: what then remains is the square of that change, 1e-4 px.
_ITERATIONS: Final = 4
_TOLERANCE: Final = 1e-3
_LARGEST: Final = 0.5
# Steps of the integration. Chosen: its error is the same before and after a step.
_STEPS_OF_A_STEP: Final = np.int64(8)


@dataclass(frozen=True)
class IntegratedBeam:
    """Beam with `widths` coefficients of its width, and `bow` of its bow, as a `Beam`.

    `radius` is that at the clamp, over the length.
    """

    widths: int
    bow: int
    radius: float

    @cached_property
    def parameters(self) -> Parameters:
        """Those of the contact, of the width and of the bow."""
        return self.of_section()

    def of_section(self) -> Parameters:
        """Return the parameters of the contact, of the width and of the bow."""
        return Parameters((*CONTACT, ("widths", self.widths), ("bow", self.bow)))

    @property
    def prior(self) -> Mapping[str, Prior]:
        """No others."""
        return {}

    @property
    def positive(self) -> tuple[int, ...]:
        """Load and place."""
        return (Q, S_C)

    def bent(self, p: Floats) -> BentBeam | None:
        """Compute the shape with parameters p (k,); None if no beam has it."""
        curve, contact, gradients, moment, by_moment = bent_beam(p, self.widths, self.radius, STEPS)
        if not curve.exists:
            return None
        return BentBeam(curve, contact[None], gradients[None], moment, by_moment)

    def radius_at(self, p: Floats, s: float) -> Radius:
        """Compute the radius at the arc length s."""
        widths = p[OWN : OWN + self.widths]
        terms, gradient = np.zeros(max(self.widths, 1)), np.zeros(len(self.parameters))
        width, slope = width_at(s, widths, terms)
        gradient[S_C] = self.radius * slope
        gradient[OWN : OWN + self.widths] = self.radius * terms[: self.widths]
        return Radius(self.radius * width, gradient)

    def after_step(self, p: Floats, step: Floats, ray: float) -> Floats:
        """Return shape and clamp (k + 5,) after a step, in which the free end moves straight."""
        size = len(self.parameters)
        return straight_in_free_end(p, step, size, self.widths, self.radius, ray)


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


def straight_in_moments(p: Floats, step: Floats) -> Floats:
    """Return the parameters (p,) after a step (p,), by linear theory of a uniform beam.

    The beam beyond the contact depends on q s_c^2 and q s_c^3 only, and linearly on both.
    """
    after, arc = p + step, p[S_C]
    slope = arc**2 * (p[Q] + step[Q]) + 2 * p[Q] * arc * step[S_C]
    offset = arc**3 * (p[Q] + step[Q]) + 3 * p[Q] * arc**2 * step[S_C]
    if slope > 0 < offset:
        after[S_C] = offset / slope
        after[Q] = slope / after[S_C] ** 2
    return after


def straight_in_free_end(
    p: Floats, step: Floats, size: int, widths: int, radius: float, ray: float
) -> Floats:
    """Return the parameters (p,) after a step (p,), by the exact beam.

    The first `size` parameters are those of the shape; `widths` and `radius` are those of
    `integrated.curve_of`; `ray` is y_v / z_v of the rays to the camera. Where no beam has such an
    end, the result is that of linear theory.
    """
    start = straight_in_moments(p, step)
    after = start.copy()
    return after if _solve(p, step, size, widths, radius, ray, after) else start


@njit
def _free_end(
    p: Floats, size: int, widths: int, radius: float, ray: float, end: Floats, by_end: Floats
) -> bool:
    """Write apparent angle and distance (2,) of the free end, and their gradients (2, p).

    These are against the compliant clamp without load. Return False if there is no such beam.
    """
    shape, soft = p[:size], size + SOFTNESS
    curve = curve_of(shape, widths, radius, _STEPS_OF_A_STEP)
    if not curve.exists:
        return False
    (_, theta, x, y, _, _), by_contact = contact_of(curve, shape)
    moment, by_moment = clamp_moment(curve, shape)
    sine, cosine = np.sin(theta), np.cos(theta)
    end[0], end[1] = theta + p[soft] * moment, x * sine - y * cosine
    along = x * cosine + y * sine
    by_end[:] = 0.0
    by_end[0, soft] = moment
    for i in range(size):
        by_end[0, i] = by_contact[1, i] + p[soft] * by_moment[i]
        by_end[1, i] = (
            by_contact[2, i] * sine - by_contact[3, i] * cosine + along * by_contact[1, i]
        )
    cosine, sine = np.cos(p[size + PSI]), np.sin(p[size + PSI])
    seen = cosine - ray * sine
    for j in range(2):
        for i in range(soft + 1):
            by_end[j, i] *= seen
        by_end[j, size + PSI] = -end[j] * (sine + ray * cosine)
        end[j] *= seen
    return True


@njit
def _solve(
    p: Floats, step: Floats, size: int, widths: int, radius: float, ray: float, after: Floats
) -> bool:
    """Write load and place whose free end is that of a straight step; return whether they exist."""
    target, end, by_end = np.empty(2), np.empty(2), np.empty((2, len(p)))
    if not _free_end(p, size, widths, radius, ray, target, by_end):
        return False
    for i in range(size + SOFTNESS + 1):
        target[0] += by_end[0, i] * step[i]
        target[1] += by_end[1, i] * step[i]
    for _ in range(_ITERATIONS):
        if not (after[Q] > 0 and 0 < after[S_C] < END):
            return False
        if not _free_end(after, size, widths, radius, ray, end, by_end):
            return False
        angle, distance = target[0] - end[0], target[1] - end[1]
        determinant = by_end[0, Q] * by_end[1, S_C] - by_end[0, S_C] * by_end[1, Q]
        load = (angle * by_end[1, S_C] - distance * by_end[0, S_C]) / determinant / after[Q]
        place = (by_end[0, Q] * distance - by_end[1, Q] * angle) / determinant / after[S_C]
        # Not fulfilled by NaN.
        if not (abs(load) < _LARGEST and abs(place) < _LARGEST):
            return False
        after[Q] *= 1 + load
        after[S_C] *= 1 + place
        if abs(load) < _TOLERANCE and abs(place) < _TOLERANCE:
            break
    return True
