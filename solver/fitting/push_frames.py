"""Collect the bent frames of a push, each fitted by itself, with a start of their joint fit."""

import math
from typing import NamedTuple

import numpy as np

from solver.beams.beam import S_C, Q
from solver.core.once import once
from solver.fitting.frame_estimate import fit_with_neighbours, with_bow
from solver.fitting.frame_problem import OwnBeamOf, frame_problem_of, only
from solver.fitting.push_beam import PushBeam, PushPoints
from solver.fitting.push_joint import PushFrame
from solver.fitting.verdict import refusal_of
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit
from solver.uniform.problem import problem_of


class BentFrames(NamedTuple):
    """Frames with contact and a motor angle, without outliers, and the beam with their points.

    A start of the joint fit: q [1/m^2] of each frame (n,), parameters of beam and clamp (b,), and
    the distance of the contact from the clamp [m], that of the frame which determines it best.
    """

    frames: tuple[PushFrame, ...]
    beam: PushBeam
    q: Floats
    base: Floats
    distance: float


def bent_frames(measurement: Measurement, own_beam: OwnBeamOf | None = None) -> BentFrames | None:
    """Return the bent frames of a push and its last `measurement`; None if there is none.

    Each frame is fitted by itself first, which gives the outliers, the variance inflation of the
    other points, and the contact. `own_beam` is that of `frame_problem_of`.
    """
    frames: list[PushFrame] = []
    fitted: list[_Fitted] = []
    begins = True
    for frame in (*measurement.earlier, measurement):
        result = _fitted(frame, own_beam)
        begins = begins or result is Outcome.NO_CONTACT
        if isinstance(result, Outcome) or frame.motor_angle is None:
            continue
        frames.append(PushFrame(frame.motor_angle, begins))
        fitted.append(result)
        begins = False
    if not frames:
        return None
    length = measurement.rig.beam.length
    beam = PushBeam(tuple(one.points for one in fitted), measurement.rig)
    best = min(fitted, key=lambda one: float(one.fit.covariance[S_C, S_C]))
    bent = best.points.problem.bent(best.fit.p)
    assert bent is not None, "the fit has a shape"
    _, _, x_c, y_c, _, _ = bent.contacts[-1]
    q = np.array([one.fit.p[Q] for one in fitted]) / length**2
    return BentFrames(
        tuple(frames), beam, q, best.fit.p[beam.fitted], math.hypot(x_c, y_c) * length
    )


class _Fitted(NamedTuple):
    """Fit of a frame with contact, and its points."""

    fit: FrameFit
    points: PushPoints


@once
def _fitted(frame: Measurement, own_beam: OwnBeamOf | None) -> _Fitted | Outcome:
    bowed = with_bow(frame)
    # As in `exact_fit`, without tips: a detected tip may be an occluder's edge.
    problem = problem_of(bowed, with_tip=False)
    fitted = None
    if problem.points:
        fitted = fit_with_neighbours(problem, frame_problem_of(bowed, problem, own_beam=own_beam))
    fit = None if fitted is None else fitted.in_order(problem)
    refusal = refusal_of(frame, problem, fit)
    if fitted is None or fit is None or refusal is not None:
        return Outcome.NOT_CONVERGED if refusal is None else refusal.outcome
    inliers = only(fitted.model, fitted.fit.kept)
    return _Fitted(fit, PushPoints(inliers, fit.variance_inflation))
