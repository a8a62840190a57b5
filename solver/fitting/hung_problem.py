"""Fit of a beam with a hung weight: the direction of its force is known, not its friction ratio.

The parameter `friction_ratio` of the shape is replaced by the error of gravity's direction, which
has a prior; the friction ratio follows from the direction, as in `beams.dead_load`. The weight
hangs on the beam's axis: its force has no lever about the place at which it acts.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from solver.beams.beam import ERRORS, FRICTION_RATIO
from solver.beams.dead_load import FrictionRatio, friction_ratio_of
from solver.beams.integrated import straight_in_moments
from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Assumption
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Gravity
from solver.instrument.transforms import turn_about_z
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem


@dataclass(frozen=True, kw_only=True)
class HungProblem(FrameProblem):
    """Points of one frame of a beam under a weight, with the prior of its parameters.

    The parameters are those of `FrameProblem`, but for the friction ratio's: it is the error [rad]
    of the direction of gravity. `direction` [rad] is the angle of the axis across gravity, in the
    frame of the beam at rest: 0 where gravity pulls across the beam. `bent` takes the parameters
    of `with_friction_ratio`.
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
        """Write the residuals (n,) of shape and clamp p, and their Jacobian."""
        found = self._friction_ratio(p)
        if found is None:
            return False
        exists = super().residuals(_replaced(p, found.value), residual, jacobian)
        if exists:
            by_friction_ratio = jacobian[FRICTION_RATIO].copy()
            jacobian[FRICTION_RATIO] = 0.0
            jacobian += np.outer(_by_error(found), by_friction_ratio)
        return exists

    def with_friction_ratio(self, fit: FrameFit) -> FrameFit:
        """Convert a fit to the parameters of `FrameProblem`, with friction ratio and covariance."""
        own = self.parameters[ERRORS]
        found = self._friction_ratio(fit.p[:own])
        assert found is not None, "the fit has residuals"
        to_shape = np.eye(len(fit.p))
        to_shape[FRICTION_RATIO] = np.append(_by_error(found), np.zeros(len(fit.p) - own))
        p = _replaced(fit.p, found.value)
        return replace(fit, p=p, covariance=to_shape @ fit.covariance @ to_shape.T)

    def _friction_ratio(self, p: Floats) -> FrictionRatio | None:
        """Find the friction ratio at shape and clamp p (p,); None if no beam has that shape."""
        across = self.direction + float(p[FRICTION_RATIO])
        return friction_ratio_of(self.beam, p, across + math.pi / 2)


def _replaced(p: Floats, friction_ratio: float) -> Floats:
    """Return the parameters with the friction ratio in the place of the direction's error."""
    replaced = p.copy()
    replaced[FRICTION_RATIO] = friction_ratio
    return replaced


def _by_error(found: FrictionRatio) -> Floats:
    """Return the friction ratio's gradient by the parameters, the direction's error among them."""
    gradient = found.gradient.copy()
    gradient[FRICTION_RATIO] = found.by_direction
    return gradient


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
    model = frame_problem_of(measurement, problem, at_axis=True)
    tolerances = measurement.rig.tolerances
    encoder = 0.0 if measurement.motor_angle is None else tolerances.encoder
    sigma = math.hypot(gravity.sigma, encoder, tolerances.board_rotation)
    information = model.information.copy()
    information[FRICTION_RATIO, FRICTION_RATIO] = sigma**-2 if sigma else 0.0
    free = sorted({*model.free} - {FRICTION_RATIO} | ({FRICTION_RATIO} if sigma else set()))
    values = {field.name: getattr(model, field.name) for field in fields(model)}
    values |= {"information": information, "free": np.array(free), "rigid": None}
    return HungProblem(**values, direction=direction_of_load(measurement, gravity))
