"""Bent frames of pushes, and their problems for a beam."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from solver.beams.stretch import WIDTHS
from solver.core.correlation import correlation_length
from solver.fitting.frame_estimate import fit_frame, with_bow
from solver.fitting.frame_problem import FrameProblem, frame_problem_of, only
from solver.fitting.neighbours import Neighbours, neighbours_of, with_neighbours
from solver.fitting.reflected_light import (
    TouchedPlace,
    lit_by_objects,
    reflection_matters,
    touched_place,
)
from solver.fitting.rigid_object import with_friction_sign
from solver.fitting.robust_fit import residuals_at, uniform_start
from solver.fitting.verdict import refusal_of
from solver.instrument.arrays import Floats, Mask
from solver.instrument.beam_shape import BeamShape
from solver.instrument.measurement import Measurement
from solver.uniform.problem import problem_of
from solver.uniform.residuals import SIGMA_X, SIGMA_Y


class BentFrame(NamedTuple):
    """A frame with contact: its measurement with the bow, and its inliers as sorted for the fit.

    `starts` (2, 3) are load, place and friction ratio of a uniform beam and of the frame's own fit,
    whose prior was a cone with the tip's width `taper`; `inflation` is the factor of its variances,
    and `correlation` the correlation length of its residuals; `touch` is its contact,
    `friction_sign` that of its friction ratio at a rigid object, and `neighbours` are the errors
    that its neighbouring points share.
    """

    measurement: Measurement
    inliers: Mask
    starts: Floats
    taper: float
    inflation: float
    correlation: float
    touch: TouchedPlace
    friction_sign: int
    neighbours: Neighbours | None = None


def bent_frame(measurement: Measurement, prior: BeamShape) -> BentFrame | None:
    """Fit a frame by itself; None if it shows no contact with a cone of this prior."""
    bowed = with_bow(_with_shape(measurement, prior))
    problem = problem_of(bowed, with_tip=False)
    fitted = fit_frame(problem, frame_problem_of(bowed, problem)) if problem.points else None
    if fitted is None or refusal_of(measurement, problem, fitted.in_order(problem)) is not None:
        return None
    model, fit = fitted.model, fitted.fit
    rows = residuals_at(model, fit.p)
    if rows is None:
        return None
    inliers = fit.kept
    start = uniform_start(problem, model)
    return BentFrame(
        measurement=bowed,
        inliers=inliers,
        starts=np.array([fit.p[:WIDTHS] if start is None else start[:WIDTHS], fit.p[:WIDTHS]]),
        taper=float(fit.p[WIDTHS]),
        inflation=float(fit.variance_inflation),
        correlation=correlation_length(rows[0][inliers]),
        touch=touched_place(model, fit.p),
        friction_sign=model.friction_sign,
    )


def problems_of(frames: Sequence[BentFrame], shape: BeamShape) -> list[FrameProblem]:
    """Return the frames' problems with this stated or learned beam, without outliers."""
    problems = [_problem(frame, shape) for frame in frames]
    # The frames have the same parameters: all of them are lit, or none.
    if any(map(reflection_matters, problems)):
        problems = [
            lit_by_objects(problem, frame.touch)
            for frame, problem in zip(frames, problems, strict=True)
        ]
    return [_of_inliers(frame, problem) for frame, problem in zip(frames, problems, strict=True)]


def with_shared_errors(
    frames: Sequence[BentFrame], shape: BeamShape, parameters: Floats
) -> list[BentFrame]:
    """Add the errors that neighbouring points share, from `parameters` (n, c) of n frames' fits.

    These take the place of the inflation.
    """
    alone = [frame._replace(inflation=1.0) for frame in frames]
    result = []
    for i, problem in enumerate(problems_of(alone, shape)):
        p = np.append(parameters[i], np.zeros(problem.own_errors))
        found = neighbours_of(problem, p, np.ones(len(problem.shared), np.bool_))
        result.append(frames[i] if found is None else alone[i]._replace(neighbours=found))
    return result


def _problem(frame: BentFrame, shape: BeamShape) -> FrameProblem:
    measurement = _with_shape(frame.measurement, shape)
    problem = frame_problem_of(measurement, problem_of(measurement, with_tip=False))
    return with_friction_sign(problem, frame.friction_sign)


def _of_inliers(frame: BentFrame, problem: FrameProblem) -> FrameProblem:
    if frame.neighbours is not None:
        problem = with_neighbours(problem, frame.neighbours)
    points = problem.points.copy()
    points[[SIGMA_X, SIGMA_Y]] *= np.sqrt(frame.inflation)
    widened = replace(problem, points=points, shared=problem.shared / np.sqrt(frame.inflation))
    return only(widened, frame.inliers)


def _with_shape(measurement: Measurement, shape: BeamShape) -> Measurement:
    return replace(measurement, rig=replace(measurement.rig, shape=shape))
