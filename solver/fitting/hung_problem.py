"""Fit of a beam with a hung weight: the direction of its force is known, not its friction ratio.

An object's force is inclined against the beam's normal by unknown friction; a weight's is inclined
by the beam's own slope. So the parameter `friction_ratio` of the shape is replaced by the error of
gravity's direction, which has a prior, and the friction ratio follows from

    psi_0(q, s_c, friction ratio, ...) + tilt + softness M_0 = direction + error,

where psi_0 is the angle of the axis across the force to the beam at its clamp, which is turned by
the tilt and by its moment M_0, and `direction` that of the same axis in the frame of the beam at
rest. The weight hangs on the beam's axis: its force has no lever about the place at which it acts.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Final, NamedTuple

import numpy as np

from solver.beam_models.curve import MOST_ANGLE
from solver.beam_models.rod import FRICTION_RATIO, S_C, STEPS, Q, curve_of
from solver.fitting.fit import FrameFit
from solver.fitting.problem import Problem
from solver.fitting.rod_problem import RodProblem, rod_problem_of
from solver.fitting.rod_residuals import SOFTNESS, TILT, clamp_moment, rod_residuals
from solver.fitting.rod_step import straight_in_moments
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Assumption
from solver.instrument.gravity import Gravity
from solver.instrument.measurement import Measurement
from solver.instrument.transforms import turn_about_z

# Newton's method for the friction ratio: largest error of the direction [rad], largest change of
# the force's angle in a step [rad], and most steps. Chosen: rounding is 1e-15, and three to five
# steps suffice.
_TOLERANCE: Final = 1e-13
_MAX_STEP: Final = 0.5
_MAX_STEPS: Final = 30


class _FrictionRatio(NamedTuple):
    """Parameters with the friction ratio for the direction's error, and its gradient (p,)."""

    p: Floats
    gradient: Floats


@dataclass(frozen=True, kw_only=True)
class HungProblem(RodProblem):
    """Points of one frame of a beam under a weight, with the prior of its parameters.

    The parameters are those of `RodProblem`, but for the friction ratio's: it is the error [rad] of
    the direction of gravity. `direction` [rad] is the angle of the axis across gravity, in the
    frame of the beam at rest: 0 where gravity pulls across the beam.
    """

    direction: float

    @property
    def of_friction_ratio(self) -> Assumption:
        """What the rig states of the error of the direction."""
        return Assumption.GRAVITY

    def moved(self, p: Floats, step: Floats) -> Floats:
        """Return the parameters (p,) after a step (p,) of a fit, by linear theory."""
        return straight_in_moments(p, step)

    def residuals(self, p: Floats, residual: Floats, jacobian: Floats) -> bool:
        """Write the residuals (n,) of shape and pose p, and their Jacobian, as `rod_residuals`."""
        friction_ratio = self._with_friction_ratio(p)
        exists = friction_ratio is not None and bool(
            rod_residuals(
                friction_ratio.p, self.points, self.view, self.widths, self.radius,
                residual, jacobian,
            )
        )  # fmt: skip
        if friction_ratio is not None and exists:
            by_friction_ratio = jacobian[FRICTION_RATIO].copy()
            jacobian[FRICTION_RATIO] = 0.0
            jacobian += np.outer(friction_ratio.gradient, by_friction_ratio)
        return exists

    def rod_fit(self, fit: FrameFit) -> FrameFit:
        """Convert a fit to the parameters of `RodProblem`, with friction ratio and covariance."""
        own = len(fit.p) - self.shared.shape[1]
        friction_ratio = self._with_friction_ratio(fit.p[:own])
        assert friction_ratio is not None  # the fit has residuals
        to_rod = np.eye(len(fit.p))
        to_rod[FRICTION_RATIO] = np.append(friction_ratio.gradient, np.zeros(len(fit.p) - own))
        p = np.append(friction_ratio.p, fit.p[own:])
        return replace(fit, p=p, covariance=to_rod @ fit.covariance @ to_rod.T)

    def _with_friction_ratio(self, p: Floats) -> _FrictionRatio | None:
        """Find the friction ratio at shape and pose p (p,); None if no beam has that shape."""
        size, wanted = self.shape_size, self.direction + p[FRICTION_RATIO]
        tilt, softness = p[size + TILT], p[size + SOFTNESS]
        rod = p.copy()
        # A frictionless force turns with the beam, by about q s^2 / 2.
        lean = np.clip(wanted - tilt - p[Q] * p[S_C] ** 2 / 2, -1.2, 1.2)
        for _ in range(_MAX_STEPS):
            rod[FRICTION_RATIO] = -math.tan(lean)
            curve = curve_of(rod[:size], self.widths, self.radius, STEPS)
            if not curve.exists:
                return None
            moment, by_moment = clamp_moment(curve, rod[:size])
            slope = np.zeros(len(p))
            slope[:size] = curve.by_base[:, 2] + softness * by_moment
            slope[size + TILT], slope[size + SOFTNESS] = 1.0, moment
            error = curve.base[2] + tilt + softness * moment - wanted
            by_lean = -slope[FRICTION_RATIO] * (1 + rod[FRICTION_RATIO] ** 2)
            if abs(error) < _TOLERANCE:
                gradient = -slope / slope[FRICTION_RATIO]
                gradient[FRICTION_RATIO] = 1 / slope[FRICTION_RATIO]
                return _FrictionRatio(rod, gradient)
            lean -= np.clip(error / by_lean, -_MAX_STEP, _MAX_STEP)
            if not abs(lean) < MOST_ANGLE:
                return None
        return None


def direction_of_load(measurement: Measurement, gravity: Gravity) -> float:
    """Compute `HungProblem.direction` [rad] of a frame, from -pi to pi.

    Without a reading of the motor angle the camera is fixed in the world, and Sigma_a is Sigma_o.
    """
    pull = np.array([math.cos(gravity.direction), math.sin(gravity.direction), 0.0])
    antenna_from_world = turn_about_z(-(measurement.motor_angle or 0.0))[:3, :3]
    along, across, _ = measurement.antenna_from_beam[:3, :3].T @ antenna_from_world @ pull
    return math.atan2(-along, across)


def hung_problem_of(measurement: Measurement, problem: Problem, gravity: Gravity) -> HungProblem:
    """Convert a measurement to the fit of a beam under a weight.

    The direction of gravity has the tolerance of the rig's statement, and those of the encoder, if
    the motor angle was read, and of the board's rotation, by which Sigma_a is known.
    """
    rod = rod_problem_of(measurement, problem)
    tolerances = measurement.rig.tolerances
    encoder = 0.0 if measurement.motor_angle is None else tolerances.encoder
    sigma = math.hypot(gravity.sigma, encoder, tolerances.board_rotation)
    information = rod.information.copy()
    information[FRICTION_RATIO, FRICTION_RATIO] = sigma**-2 if sigma else 0.0
    free = sorted({*rod.free} - {FRICTION_RATIO} | ({FRICTION_RATIO} if sigma else set()))
    values = {field.name: getattr(rod, field.name) for field in fields(rod)}
    values |= {"radius": 0.0, "information": information, "free": np.array(free), "rigid": None}
    return HungProblem(**values, direction=direction_of_load(measurement, gravity))
