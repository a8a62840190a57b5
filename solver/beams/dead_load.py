"""A dead load: the direction of its force is fixed in the world, not its friction ratio.

An object's force is inclined against the beam's normal by friction; a weight's is inclined by the
beam's own slope. The friction ratio of a shape under a weight follows from

    psi_0(q, s_c, friction ratio, ...) + tilt + softness M_0 = direction - pi / 2,

where psi_0 is the angle of the axis across the force to the beam at its clamp, which is turned by
the tilt and by its moment M_0. The parameters p (k + 5,) are those of shape and clamp, as in
`beam`; every gradient is by all of them. Angles are against the x axis of plane C.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO, S_C, SOFTNESS, TILT, Beam, BentBeam, Q
from solver.beams.curve import MOST_ANGLE
from solver.instrument.arrays import Floats

# Newton's method: largest error of the direction [rad], largest change of the force's angle in a
# step [rad], and most steps. Chosen: rounding is 1e-15, and three to five steps suffice.
_TOLERANCE: Final = 1e-13
_MAX_STEP: Final = 0.5
_MAX_STEPS: Final = 30


class Quantity(NamedTuple):
    """A number or a vector (m,), and its gradient, (k + 5,) or (m, k + 5)."""

    value: Floats
    gradient: Floats


class FrictionRatio(NamedTuple):
    """Friction ratio that gives the force a direction; its gradient by p and by the direction."""

    value: float
    gradient: Floats
    by_direction: float


def turn_of(bent: BentBeam, p: Floats) -> Quantity:
    """Compute the angle of the clamp's tangent under load: its tilt, and what the clamp gives."""
    k = len(bent.by_moment)
    gradient = np.zeros(len(p))
    gradient[:k] = p[k + SOFTNESS] * bent.by_moment
    gradient[k + TILT], gradient[k + SOFTNESS] = 1.0, bent.moment
    return Quantity(np.asarray(p[k + TILT] + p[k + SOFTNESS] * bent.moment), gradient)


def direction_of(bent: BentBeam, p: Floats) -> Quantity:
    """Compute the angle [rad] of the force, towards y."""
    turn = turn_of(bent, p)
    (_, theta, *_, lean), (_, by_theta, *_, by_lean) = bent.contacts[-1], bent.by_contacts[-1]
    gradient = turn.gradient.copy()
    gradient[: len(bent.by_moment)] += by_theta + by_lean
    return Quantity(theta + lean + np.pi / 2 + turn.value, gradient)


def friction_ratio_of(beam: Beam, p: Floats, direction: float) -> FrictionRatio | None:
    """Find the friction ratio for which the force has a `direction` (Newton's method).

    The ratio in p is not used. Return None if no beam has such a force.
    """
    k, trial = len(beam.parameters), p.copy()
    # A frictionless force turns with the beam, by about q s^2 / 2.
    turned = direction - math.pi / 2 - p[k + TILT] - p[Q] * p[S_C] ** 2 / 2
    lean = float(np.clip(turned, -1.2, 1.2))
    for _ in range(_MAX_STEPS):
        trial[FRICTION_RATIO] = -math.tan(lean)
        bent = beam.bent(trial[:k])
        if bent is None:
            return None
        at = direction_of(bent, trial)
        error = float(at.value) - direction
        by_ratio = at.gradient[FRICTION_RATIO]
        if abs(error) < _TOLERANCE:
            gradient = -at.gradient / by_ratio
            gradient[FRICTION_RATIO] = 0.0
            return FrictionRatio(float(trial[FRICTION_RATIO]), gradient, float(1 / by_ratio))
        slope = -by_ratio * (1 + trial[FRICTION_RATIO] ** 2)
        lean -= float(np.clip(error / slope, -_MAX_STEP, _MAX_STEP))
        if not abs(lean) < MOST_ANGLE:
            return None
    return None
