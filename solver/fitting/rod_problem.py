"""Convert a measurement to the arrays of the fit of a beam of changing section."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from solver.beam_models.rod import FRICTION_RATIO, S_C, WIDTHS, Q
from solver.fitting.fit import FrameFit
from solver.fitting.problem import Problem
from solver.fitting.residuals import LEAST_SIGMA, SIGMA_X, SIGMA_Y
from solver.fitting.rod_residuals import DX, DY, POSE, PSI, SOFTNESS, TILT, rod_residuals
from solver.fitting.rod_step import straight_in_free_end
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BOW, SKEW, BeamShape, Friction
from solver.instrument.estimate import Assumption
from solver.instrument.measurement import Measurement, RestBow

# Sigma of the shift of a beam's apparent middle at the contact, in radii, by light that the object
# reflects. Measured: a gray cylinder as thick as the beam moves it by 0.001 to 0.003.
REFLECTED: Final = 0.003
# Its size, in sigmas of a point, below which it is neglected. Chosen: it moves a few dozen points.
LEAST_REFLECTION: Final = 0.5
# Part of the variance of what objects do, by their light or friction, that is the same for all
# objects of a rig. Chosen: they may be alike or not.
SHARED_VARIANCE_FRACTION: Final = 0.5
# Least variance of a combination of parameters, over those of its parts. Chosen: a ten-thousandth
# of their sigmas is certain.
_CERTAIN: Final = 1e-8


class RigidObjects(NamedTuple):
    """Motor's axis (2,), over the length from where the beam begins to bend; objects' friction."""

    axis: Floats
    friction: Friction


@dataclass(frozen=True)
class RodProblem:
    """Points of one frame and the prior of its parameters, in units of the beam's length.

    `points` (4, n) and `view` (3,) are those of `residuals`; `widths` and `radius` those of
    `rod.curve_of`. The parameters are those of `rod_residuals`, and then the errors that all points
    share: `shared` (n, k) is the shift of each point, in sigmas, by one sigma of each. `mean` (p,)
    and `information` (p, p) are their prior; `free` (f,) are the indices of those that are fitted.
    The last `own_errors` parameters are errors that only the points of this frame share. `rigid`
    is known where the rig states that objects are, and `friction_sign` is that of the friction
    ratio against the rig's other frames: 0 if it is not known.
    """

    points: Floats
    view: Floats
    widths: int
    radius: float
    shared: Floats
    mean: Floats
    information: Floats
    free: Any
    own_errors: int = 0
    rigid: RigidObjects | None = None
    friction_sign: int = 1

    @property
    def of_friction_ratio(self) -> Assumption:
        """What the rig states of the parameter FRICTION_RATIO."""
        return Assumption.FRICTION

    @property
    def shape_size(self) -> int:
        """Number of parameters of the shape, which come first."""
        return len(self.mean) - POSE - int(self.shared.shape[1])

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

    @property
    def positive(self) -> tuple[int, ...]:
        """Indices of parameters that stay positive, and at most double in one step of a fit."""
        return (Q, S_C)

    def moved(self, p: Floats, step: Floats) -> Floats:
        """Return the parameters (p,) after a step (p,) of a fit, along the objective's valley."""
        size, ray = self.shape_size, float(self.view[1])
        return straight_in_free_end(p, step, size, self.widths, self.radius, ray)

    def rod_fit(self, fit: FrameFit) -> FrameFit:
        """Return a fit of this problem with the parameters of `rod_residuals`."""
        return fit

    def residuals(self, p: Floats, residual: Floats, jacobian: Floats) -> bool:
        """Write the residuals (n,) of shape and pose p, and their Jacobian, as `rod_residuals`."""
        return bool(
            rod_residuals(
                p, self.points, self.view, self.widths, self.radius, residual,
                jacobian,
            )
        )  # fmt: skip


P = TypeVar("P", bound=RodProblem)


def rod_problem_of(measurement: Measurement, problem: Problem) -> RodProblem:
    """Add the stated or learned beam of the measurement's rig to the arrays of `problem`."""
    points, view = problem.arrays.points, problem.arrays.viewpoint
    bow = measurement.rest_bow
    shared = problem.shared_errors[:, 0 if bow is None else bow.errors :]
    radius = measurement.rig.beam.radius / measurement.rig.beam.length
    mean, covariance = _prior(measurement, shared.shape[1], reflection(points, radius))
    uncertain = np.flatnonzero(np.diag(covariance) > 0)
    information = np.zeros_like(covariance)
    block = np.ix_(uncertain, uncertain)
    information[block] = _information(covariance[block])
    return RodProblem(
        points=points,
        view=view,
        widths=len(measurement.rig.shape.widths),
        radius=radius,
        shared=shared,
        mean=mean,
        information=information,
        free=np.array([Q, S_C, *uncertain]),
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


def _information(covariance: Floats) -> Floats:
    """Invert a covariance (p, p) that may be singular, as where a bow is undecided."""
    # In units of the sigmas, which differ by orders of magnitude.
    sigmas = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sigmas, sigmas))
    inverse = (vectors / np.maximum(values, _CERTAIN)) @ vectors.T
    return np.asarray(inverse / np.outer(sigmas, sigmas))


def _prior(measurement: Measurement, shared: int, light: float) -> tuple[Floats, Floats]:
    """Compute mean (p,) and covariance (p, p) of all parameters but load and place.

    `light` is the sigma of light that is reflected onto the beam, in sigmas of a point: that
    of the hub near the clamp looks like a bow.
    """
    shape, rest = measurement.rig.shape, measurement.rest_bow
    first = WIDTHS + len(shape.widths)
    size = first + (0 if rest is None else BOW)
    mean = np.zeros(size + POSE + shared)
    covariance = np.zeros((len(mean), len(mean)))
    covariance[FRICTION_RATIO, FRICTION_RATIO] = shape.ratio_sigma**2
    mean[size + PSI] = measurement.handedness * (measurement.rig.known_psi or 0.0)
    own = np.arange(size + POSE, len(mean))
    covariance[own, own] = 1.0
    values, shape_covariance = in_beam_frame(shape, measurement.handedness)
    learned = [size + entry for entry in (SOFTNESS, DX, PSI)]
    learned += range(WIDTHS, size)[: len(shape.widths) + (0 if rest is None else len(shape.bow))]
    count = len(learned)
    mean[learned] += values[:count]
    covariance[np.ix_(learned, learned)] = shape_covariance[:count, :count]
    unit = np.array([1, 1, measurement.rig.beam.length]) / measurement.rig.beam.length
    pose = slice(size + DX, size + TILT + 1)
    covariance[pose, pose] += measurement.base_covariance * np.outer(unit, unit)
    if rest is not None:
        line, bow = [size + DY, size + TILT], list(range(first, size))
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
    sigma = float(np.median(np.hypot(points[SIGMA_X], points[SIGMA_Y])))
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


def only(problem: RodProblem, kept: Any) -> RodProblem:
    """Return the problem with only the `kept` (n,) points."""
    return replace(
        problem,
        points=np.ascontiguousarray(problem.points[:, kept]),
        shared=problem.shared[kept],
    )
