"""Steps of a fit that follow the curved valley of its objective.

Load and place of a contact can change a lot together with taper, friction, bow and clamp, while the
beam beyond the contact stays where it is, as the points there require. A step of all parameters is
therefore straight in the angle of that end and in its distance from the clamp; load and place
follow from these. So does an inclination of the plane: to first order an image shows the deflection
times cos(psi) - (y_v / z_v) sin(psi).
"""

from typing import Final

import numpy as np

from solver.beams.beam import PSI, S_C, SOFTNESS, Q
from solver.beams.curve import END
from solver.beams.integrated import clamp_moment, contact_of, curve_of
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Newton's method: most iterations, relative change at its end, and largest relative change in one
# of them. Chosen: what then remains is the square of that change, a hundredth of a pixel's
# hundredth.
_ITERATIONS: Final = 4
_TOLERANCE: Final = 1e-3
_LARGEST: Final = 0.5
# Steps of the integration. Chosen: its error is the same before and after a step.
_STEPS: Final = np.int64(8)


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

    These are against the clamp without load, which gives. Return False if there is no such beam.
    """
    shape, soft = p[:size], size + SOFTNESS
    curve = curve_of(shape, widths, radius, _STEPS)
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
