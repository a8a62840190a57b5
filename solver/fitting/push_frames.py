"""Collect the bent frames of a push, each fitted by itself, with a start of their joint fit."""

from collections.abc import Callable, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from solver.beams.beam import S_C, Q
from solver.beams.linear import unit_deflection
from solver.core.once import once
from solver.fitting.fit_estimate import refusal_of
from solver.fitting.frame_estimate import fit_with_neighbours, with_bow
from solver.fitting.frame_problem import OwnBeamOf, frame_problem_of, only
from solver.fitting.push_beam import PushBeam, PushFrame
from solver.fitting.push_integrated import IntegratedPoints, IntegratedPush
from solver.fitting.push_uniform import UniformPoints, UniformPush
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit, fit_from, start_of
from solver.uniform.problem import problem_of, without
from solver.uniform.residuals import LEVER

Points = TypeVar("Points", UniformPoints, IntegratedPoints)


class BentFrames(NamedTuple):
    """Frames with contact and a motor angle, without outliers, and the beam with their points.

    A start of the joint fit: q [1/m^2] of each frame (n,), parameters of beam and clamp (b,), and
    the place of the contact [m], that of the frame which determines it best.
    """

    frames: tuple[PushFrame, ...]
    beam: PushBeam
    q: Floats
    base: Floats
    place: float


def bent_frames(measurement: Measurement, own_beam: OwnBeamOf | None = None) -> BentFrames | None:
    """Return the bent frames of a push and its last `measurement`; None if there is none.

    Each frame is fitted by itself first, which gives the outliers, the variance inflation of the
    other points, and the contact. `own_beam` is that of `frame_problem_of`.
    """
    rig, length = measurement.rig, measurement.rig.beam.length
    if own_beam is None and measurement.uniform:
        frames, points, fits = _collected(measurement, _uniform, None)
        if not frames:
            return None
        place = _best(fits, LEVER).p[LEVER] * length
        beam = UniformPush(points, rig, measurement.base_covariance)
        q = np.array([_linear_q(one, place, length) for one in points])
        return BentFrames(frames, beam, q, np.zeros(3), place)
    frames, rod_points, fits = _collected(measurement, _rod, own_beam)
    if not frames:
        return None
    rod, best = IntegratedPush(rod_points, rig), _best(fits, S_C)
    q = np.array([fit.p[Q] for fit in fits]) / length**2
    return BentFrames(frames, rod, q, best.p[rod.fitted], best.p[S_C] * length)


def _best(fits: Sequence[FrameFit], place: int) -> FrameFit:
    """Return the fit that determines its contact best; `place` is the index of that parameter."""
    return min(fits, key=lambda fit: float(fit.covariance[place, place]))


class _Fitted(NamedTuple, Generic[Points]):
    """Fit of a frame with contact, and its points."""

    fit: FrameFit
    points: Points


class _Collected(NamedTuple, Generic[Points]):
    frames: tuple[PushFrame, ...]
    points: tuple[Points, ...]
    fits: tuple[FrameFit, ...]


def _collected(
    measurement: Measurement,
    fitted: Callable[[Measurement, OwnBeamOf | None], _Fitted[Points] | Outcome],
    own_beam: OwnBeamOf | None,
) -> _Collected[Points]:
    """Fit all frames of a push; those without contact or motor angle are left out."""
    frames: list[PushFrame] = []
    fits: list[_Fitted[Points]] = []
    begins = True
    for frame in (*measurement.earlier, measurement):
        result = fitted(frame, own_beam)
        begins = begins or result is Outcome.NO_CONTACT
        if isinstance(result, Outcome) or frame.motor_angle is None:
            continue
        frames.append(PushFrame(frame.motor_angle, begins))
        fits.append(result)
        begins = False
    return _Collected(
        tuple(frames), tuple(one.points for one in fits), tuple(one.fit for one in fits)
    )


@once
def _uniform(frame: Measurement, own_beam: OwnBeamOf | None) -> _Fitted[UniformPoints] | Outcome:
    del own_beam
    # As in `exact_fit`, without tips: a detected tip may be an occluder's edge.
    problem = problem_of(frame, with_tip=False)
    start = start_of(problem, 0.0) if problem.points else None
    fit = None if start is None else fit_from(problem, start, psi_free=False)
    refusal = refusal_of(frame, problem, fit)
    if fit is None or refusal is not None:
        return Outcome.NOT_CONVERGED if refusal is None else refusal.outcome
    inliers = problem if fit.kept.all() else without(problem, fit.kept)
    return _Fitted(fit, UniformPoints(inliers, fit.variance_inflation))


@once
def _rod(frame: Measurement, own_beam: OwnBeamOf | None) -> _Fitted[IntegratedPoints] | Outcome:
    bowed = with_bow(frame)
    problem = problem_of(bowed, with_tip=False)
    fitted = None
    if problem.points:
        fitted = fit_with_neighbours(problem, frame_problem_of(bowed, problem, own_beam=own_beam))
    fit = None if fitted is None else fitted.in_order(problem)
    refusal = refusal_of(frame, problem, fit)
    if fitted is None or fit is None or refusal is not None:
        return Outcome.NOT_CONVERGED if refusal is None else refusal.outcome
    inliers = only(fitted.rod, fitted.fit.kept)
    return _Fitted(fit, IntegratedPoints(inliers, fit.variance_inflation))


def _linear_q(points: UniformPoints, lever: float, length: float) -> float:
    """Compute q [1/m^2] by a straight line through the points, in linear theory."""
    x, y = points.problem.arrays.points[:2] * length
    unit = unit_deflection(x, lever)
    q = 6 * float(unit @ y) / float(unit @ unit)
    # Inside the model's domain, however steep the linear shape is.
    return float(min(max(q, 1e-9), 1.6 / max(lever - x.min(), lever) ** 2))
