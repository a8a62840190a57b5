"""Direction of the force on a bent beam, its contact and its tip, in plane C.

The parameters p (k + 5,) are those of `rod_residuals`, in units of the beam's length; every
gradient is by all of them. The beam bends towards y.
"""

from typing import Final, NamedTuple

import numpy as np

from solver.beam_models.curve import Curve
from solver.beam_models.rod import FRICTION_RATIO, S_C, STEPS, WIDTHS, contact_of, curve_of
from solver.fitting.rod_residuals import POSE, SOFTNESS, TILT, clamp_moment
from solver.instrument.arrays import Floats

# A dead load acts at the beam's axis, and so does any other load on a beam of unknown diameter.
RADIUS: Final = 0.0
_MAX_ITERATIONS: Final = 30
# Error of a force's direction [rad]. Chosen: the rounding of the integration is smaller.
_EXACT: Final = 1e-12
# Nodes and weights on (0, 1). Chosen: four integrate a bow of three coefficients to 1e-9.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


class Quantity(NamedTuple):
    """A number or a vector (m,), and its gradient, (k + 5,) or (m, k + 5)."""

    value: Floats
    gradient: Floats


class FrictionRatio(NamedTuple):
    """Friction ratio that gives the force a direction; its gradient by p and by the direction."""

    value: float
    gradient: Floats
    by_direction: float


def turn_of(curve: Curve, p: Floats) -> Quantity:
    """Compute the angle of the clamp's tangent under load: its tilt, and what the clamp gives."""
    k = len(p) - POSE
    moment, by_moment = clamp_moment(curve, p[:k])
    gradient = np.zeros(len(p))
    gradient[:k] = p[k + SOFTNESS] * by_moment
    gradient[k + TILT], gradient[k + SOFTNESS] = 1.0, moment
    return Quantity(np.asarray(p[k + TILT] + p[k + SOFTNESS] * moment), gradient)


def direction_of(curve: Curve, p: Floats) -> Quantity:
    """Compute the angle [rad] of the force against x of plane C, towards y."""
    turn = turn_of(curve, p)
    gradient = turn.gradient.copy()
    gradient[: len(p) - POSE] += curve.by_base[:, 2]
    return Quantity(curve.base[2] + np.pi / 2 + turn.value, gradient)


def friction_ratio_of(p: Floats, widths: int, direction: float) -> FrictionRatio | None:
    """Find the friction ratio for which the force has a `direction` (Newton's method).

    The ratio in p is not used. Return None if no beam has such a force.
    """
    k, lean = len(p) - POSE, 0.0
    trial = p.copy()
    for _ in range(_MAX_ITERATIONS):
        trial[FRICTION_RATIO] = -np.tan(lean)
        curve = curve_of(trial[:k], widths, RADIUS, STEPS)
        if not curve.exists:
            return None
        at = direction_of(curve, trial)
        error = float(at.value) - direction
        # By the lean, -atan(friction ratio); almost 1 for a small deflection.
        slope = -at.gradient[FRICTION_RATIO] * (1 + trial[FRICTION_RATIO] ** 2)
        if abs(error) < _EXACT:
            gradient = -at.gradient / at.gradient[FRICTION_RATIO]
            gradient[FRICTION_RATIO] = 0.0
            return FrictionRatio(
                float(trial[FRICTION_RATIO]), gradient, float(1 / at.gradient[FRICTION_RATIO])
            )
        lean = float(np.clip(lean - error / max(slope, 0.1), -1.4, 1.4))
    return None


def contact_place(curve: Curve, p: Floats) -> Quantity:
    """Compute the place (2,) of the contact in plane C."""
    k = len(p) - POSE
    values, gradients = contact_of(curve, p[:k])
    return _turned(curve, p, values[2:4], gradients[2:4])


def tip_place(curve: Curve, p: Floats, widths: int) -> Quantity:
    """Compute the place (2,) of the tip, the arc length 1, in plane C.

    Beyond the contact the beam has its curvature at rest, so that its tangent turns by the
    difference of the slopes of the line at rest.
    """
    k = len(p) - POSE
    values, gradients = contact_of(curve, p[:k])
    bow = p[WIDTHS + widths : k]
    powers = np.arange(len(bow)) + 2.0
    span = 1 - p[S_C]
    places = p[S_C] + span * (1 + _NODES) / 2
    slopes = powers * places[:, None] ** (powers - 1) - powers * p[S_C] ** (powers - 1)
    angles = values[1] + slopes @ bow
    tangents = np.column_stack([np.cos(angles), np.sin(angles)])
    normals = np.column_stack([-np.sin(angles), np.cos(angles)])
    weights = span * _WEIGHTS / 2
    by_angle = np.zeros((len(angles), k)) + gradients[1]
    by_angle[:, WIDTHS + widths :] += slopes
    # Derivative by the lower limit, at which the angle is that of the contact.
    curvature = powers * (powers - 1) * p[S_C] ** (powers - 2) @ bow
    by_angle[:, S_C] -= curvature
    gradient = gradients[2:4] + (weights[:, None] * normals).T @ by_angle
    gradient[:, S_C] -= [np.cos(values[1]), np.sin(values[1])]
    # The places of the nodes move with the limit; the integral does not depend on them.
    return _turned(curve, p, values[2:4] + weights @ tangents, gradient)


def _turned(curve: Curve, p: Floats, place: Floats, by_shape: Floats) -> Quantity:
    """Rotate a place (2,) from the clamp's tangent to plane C."""
    turn = turn_of(curve, p)
    cosine, sine = np.cos(turn.value), np.sin(turn.value)
    rotation = np.array([[cosine, -sine], [sine, cosine]])
    gradient = np.zeros((2, len(p)))
    gradient[:, : len(p) - POSE] = rotation @ by_shape
    turned = rotation @ place
    gradient += np.array([-turned[1], turned[0]])[:, None] * turn.gradient
    return Quantity(turned, gradient)
