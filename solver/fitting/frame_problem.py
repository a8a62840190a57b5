"""Convert a measurement to the arrays of the fit of a beam of changing section."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from solver.beams.beam import ERRORS, FRICTION_RATIO, S_C, Beam, BentBeam, Q, with_clamp
from solver.beams.integrated import IntegratedBeam
from solver.core.least_squares import information_of
from solver.core.parameters import Parameters
from solver.fitting.beam_residuals import beam_residuals
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BOW, SKEW, BeamShape, Friction
from solver.instrument.estimate import Assumption
from solver.instrument.measurement import Measurement, RestBow
from solver.instrument.medians import median
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem
from solver.uniform.residuals import LEAST_SIGMA, SIGMA_X, SIGMA_Y

# Sigma of the shift of a beam's apparent middle at the contact, in radii, by light that the object
# reflects. Measured: a gray cylinder as thick as the beam moves it by 0.001 to 0.003.
REFLECTED: Final = 0.003
# Its size, in sigmas of a point, below which it is neglected. Chosen: it moves a few dozen points.
LEAST_REFLECTION: Final = 0.5
# Part of the variance of what objects do, by their light or friction, that is the same for all
# objects of a rig. Chosen: they may be alike or not.
SHARED_VARIANCE_FRACTION: Final = 0.5


class RigidObjects(NamedTuple):
    """Motor's axis (2,), over the length from where the beam begins to bend; objects' friction."""

    axis: Floats
    friction: Friction


@dataclass(frozen=True)
class FrameProblem:
    """Points of one frame and the prior of its parameters, in units of the beam's length.

    `points` (4, n) and `view` (3,) are those of `residuals`. The `parameters` are those of the
    beam's shape and of its clamp, as in `beams.beam`, and then the block "errors", which all points
    share: `shared` (n, k) is the shift of each point, in sigmas, by one sigma of each. `mean` (p,)
    and `information` (p, p) are their prior; `free` (f,) are the indices of those that are fitted.
    `lost_light` (n,) is that of the points, as in `Centreline`.
    The last `own_errors` parameters are errors that only the points of this frame share. `rigid`
    is known where the rig states that objects are, and `friction_sign` is that of the friction
    ratio against the rig's other frames: 0 if it is not known.
    """

    points: Floats
    view: Floats
    beam: Beam
    shared: Floats
    mean: Floats
    information: Floats
    free: Any
    lost_light: Floats
    own_errors: int = 0
    rigid: RigidObjects | None = None
    friction_sign: int = 1

    @property
    def of_friction_ratio(self) -> Assumption:
        """What the rig states of the parameter FRICTION_RATIO."""
        return Assumption.FRICTION

    @cached_property
    def parameters(self) -> Parameters:
        """Names of the parameters."""
        return with_errors(self.beam, self.shared.shape[1])

    @property
    def common(self) -> int:
        """Number of parameters before the errors of the frame's own."""
        return len(self.mean) - self.own_errors

    @cached_property
    def _whitener(self) -> tuple[Floats, Floats]:
        """Directions (n, k) of the frame's own errors, and the part (k,) of residuals to remove."""
        own = self.shared[:, self.shared.shape[1] - self.own_errors :]
        directions, sigmas, _ = np.linalg.svd(own, full_matrices=False)
        return directions, 1 - 1 / np.hypot(1.0, sigmas)

    def without_own_errors(self, rows: Floats) -> Floats:
        """Return rows (..., n) of residuals whose own errors are eliminated: their noise is white.

        Multiplies by (1 + E E^T)^(-1/2), where E are the errors.
        """
        directions, excess = self._whitener
        return np.asarray(rows - (rows @ directions * excess) @ directions.T)

    def bent(self, p: Floats) -> BentBeam | None:
        """Compute the shape of a fit with parameters p; None if no beam has it."""
        return self.beam.bent(p[: len(self.beam.parameters)])

    def moved(self, p: Floats, step: Floats) -> Floats:
        """Return the parameters (p,) after a step (p,) of a fit, along the objective's valley."""
        after, own = p + step, self.parameters[ERRORS]
        after[:own] = self.beam.after_step(p[:own], step[:own], float(self.view[1]))
        return after

    def with_friction_ratio(self, fit: FrameFit) -> FrameFit:
        """Return a fit of this problem with the parameters of `beams.beam`."""
        return fit

    def residuals(self, p: Floats, residual: Floats, jacobian: Floats) -> bool:
        """Write the residuals (n,) of shape and clamp p, and their Jacobian."""
        return beam_residuals(self.beam, p, self.points, self.view, residual, jacobian)


def with_errors(beam: Beam, errors: int) -> Parameters:
    """Return the parameters of a frame's fit: a beam's, its clamp's, errors of many points."""
    return with_clamp(beam.parameters).followed_by((ERRORS, errors))


P = TypeVar("P", bound=FrameProblem)
# Makes a beam of a user's own of the integrated one that a measurement's rig states.
OwnBeamOf = Callable[[Measurement, IntegratedBeam], Beam]


def frame_problem_of(
    measurement: Measurement,
    problem: Problem,
    *,
    at_axis: bool = False,
    own_beam: OwnBeamOf | None = None,
) -> FrameProblem:
    """Add the stated or learned beam of the measurement's rig to the arrays of `problem`.

    The force acts on the beam's surface, or `at_axis`, where it has no lever about its place.
    `own_beam` makes another beam of the integrated one.
    """
    points, view = problem.arrays.points, problem.arrays.viewpoint
    bow, rig = measurement.rest_bow, measurement.rig
    shared = problem.shared_errors[:, 0 if bow is None else bow.errors :]
    radius = rig.beam.radius / rig.beam.length
    stated = IntegratedBeam(
        len(rig.shape.widths), 0 if bow is None else BOW, 0.0 if at_axis else radius
    )
    beam = stated if own_beam is None else own_beam(measurement, stated)
    if not hasattr(beam, "bent"):
        raise TypeError(f"beam made a {type(beam).__name__}, allowed is a Beam")
    at = with_errors(beam, shared.shape[1])
    mean, covariance = _prior(measurement, at, reflection(points, radius))
    for name, prior in beam.prior.items():
        mean[at[name]], covariance[at[name], at[name]] = prior.mean, prior.sigma**2
    uncertain = np.flatnonzero(np.diag(covariance) > 0)
    return FrameProblem(
        points=points,
        view=view,
        beam=beam,
        shared=shared,
        mean=mean,
        information=information_of(covariance),
        free=np.array([Q, S_C, *uncertain]),
        lost_light=measurement.view.lost_light[problem.order],
        rigid=_rigid_objects(measurement),
    )


def _rigid_objects(measurement: Measurement) -> RigidObjects | None:
    """Return what the rig states of rigid objects; None without it, or without friction."""
    rig = measurement.rig
    if not (rig.shape.rigid_objects and rig.shape.friction_sigma):
        return None
    axes = measurement.antenna_from_beam[:2, :2]
    begin = axes.T @ rig.clamp_offset.position / rig.beam.length
    return RigidObjects(-begin - [rig.shape.clamp_shift, 0.0], rig.shape.friction)


def _prior(measurement: Measurement, at: Parameters, light: float) -> tuple[Floats, Floats]:
    """Compute mean (p,) and covariance (p, p) of all parameters but load and place.

    `light` is the sigma of light that is reflected onto the beam, in sigmas of a point: that
    of the hub near the clamp looks like a bow.
    """
    shape, rest = measurement.rig.shape, measurement.rest_bow
    mean, covariance = np.zeros(len(at)), np.zeros((len(at), len(at)))
    covariance[FRICTION_RATIO, FRICTION_RATIO] = shape.ratio_sigma**2
    mean[at["psi"]] = measurement.handedness * (measurement.rig.known_psi or 0.0)
    errors = at.indices(ERRORS)
    covariance[errors, errors] = 1.0
    values, shape_covariance = in_beam_frame(shape, measurement.handedness)
    learned = at.indices("softness", "dx", "psi", "widths")
    learned += [] if rest is None else at.indices("bow")[: len(shape.bow)]
    count = len(learned)
    mean[learned] += values[:count]
    covariance[np.ix_(learned, learned)] = shape_covariance[:count, :count]
    unit = np.array([1, 1, measurement.rig.beam.length]) / measurement.rig.beam.length
    pose = slice(at["dx"], at["tilt"] + 1)
    covariance[pose, pose] += measurement.base_covariance * np.outer(unit, unit)
    if rest is not None:
        line, bow = at.indices("dy", "tilt"), at.indices("bow")
        covariance[np.ix_(line, line)] -= rest.line_covariance * np.outer(unit[1:], unit[1:])
        if light > LEAST_REFLECTION:
            rest = replace(rest, covariance=rest.covariance * (1 + light**2))
        _add_rest(mean, covariance, line, bow, rest, measurement.rig.beam.length, len(shape.bow))
        mean[bow] += rest.by_weight / measurement.rig.beam.length
    return mean, covariance


def in_beam_frame(shape: BeamShape, handedness: int) -> tuple[Floats, Floats]:
    """Return the parameters (k,) of a shape and their covariance (k, k) in the beam's frame.

    Skew and bow are odd functions of the side to which the rig deflects.
    """
    values = np.array([shape.softness, shape.clamp_shift, shape.skew, *shape.widths, *shape.bow])
    sides = np.ones(len(values))
    sides[[SKEW, *range(len(values) - len(shape.bow), len(values))]] = handedness
    return values * sides, shape.covariance * np.outer(sides, sides)


def _add_rest(
    mean: Floats,
    covariance: Floats,
    line: list[int],
    bow: list[int],
    rest: RestBow,
    length: float,
    learned: int,
) -> None:
    """Add the line at rest, and its bow unless it was learned, to the prior.

    Line and bow of the rest images are correlated. A learned bow determines the line with the
    conditional covariance of the rest images, whose own bow may be a part of what was learned.
    """
    unit = np.array([1 / length, 1.0, *[1 / length] * BOW])
    joint = rest.covariance * np.outer(unit, unit)
    coefficients = rest.coefficients / length
    if not learned:
        mean[bow] = coefficients
        both = [*line, *bow]
        covariance[np.ix_(both, both)] += joint
        return
    gain = joint[:2, 2:] @ np.linalg.pinv(joint[2:, 2:], hermitian=True)
    mean[line] += gain @ (mean[bow] - coefficients)
    by_learned = gain @ covariance[bow]
    covariance[line] += by_learned
    covariance[:, line] += by_learned.T
    spread = joint[:2, :2] - gain @ joint[2:, :2] + gain @ covariance[np.ix_(bow, bow)] @ gain.T
    covariance[np.ix_(line, line)] += spread


def reflection(points: Floats, radius: float) -> float:
    """Compute the sigma of the shift by reflected light, in sigmas of the points (4, n)."""
    if not points.shape[1]:
        return 0.0
    sigma = median(np.hypot(points[SIGMA_X], points[SIGMA_Y]))
    return REFLECTED * radius / max(sigma, LEAST_SIGMA)


def with_own_errors(problem: P, columns: Floats) -> P:
    """Add errors that only the points of this frame share: `columns` (n, k) are like `shared`."""
    own = problem.own_errors + columns.shape[1]
    return replace(_with_errors(problem, columns), own_errors=own)


def with_common_errors(problem: P, columns: Floats) -> P:
    """Add errors (n, k) that the points of all frames share, to a problem without own ones."""
    assert not problem.own_errors, "a frame's own errors are the last ones"
    return _with_errors(problem, columns)


def _with_errors(problem: P, columns: Floats) -> P:
    count, added = len(problem.mean), columns.shape[1]
    information = np.eye(count + added)
    information[:count, :count] = problem.information
    return replace(
        problem,
        shared=np.column_stack([problem.shared, columns]),
        mean=np.append(problem.mean, np.zeros(added)),
        information=information,
        free=np.append(problem.free, count + np.arange(added)),
    )


def only(problem: FrameProblem, kept: Any) -> FrameProblem:
    """Return the problem with only the `kept` (n,) points."""
    return replace(
        problem,
        points=np.ascontiguousarray(problem.points[:, kept]),
        shared=problem.shared[kept],
        lost_light=problem.lost_light[kept],
    )
