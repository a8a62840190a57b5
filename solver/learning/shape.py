"""Learn the shape of a beam, with a given prior, from bent frames of pushes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from solver.fitting.frame_problem import SHARED_VARIANCE_FRACTION, FrameProblem
from solver.fitting.joint_fit import JointFit, fit_jointly
from solver.instrument.beam_shape import (
    CLAMP_SHIFT,
    FIRST_WIDTH,
    SKEW,
    SOFTNESS,
    BeamShape,
    Friction,
)
from solver.learning.pushes import BentFrame, problems_of, with_shared_errors

# Sigmas of a taper or softness beyond which it contradicts the rig's statement. Chosen.
_CONTRADICTION: Final = 3.0


@dataclass(frozen=True)
class LearnedShape:
    """Shape with its covariance, mean square of the residuals [sigma], and whether it converged."""

    shape: BeamShape
    misfit: float
    converged: bool


class Fitted(NamedTuple):
    """Joint fit of frames, the mean square of their residuals [sigma], and their problems."""

    fit: JointFit
    misfit: float
    problems: list[FrameProblem]


def fit_frames(frames: Sequence[BentFrame], shape: BeamShape) -> Fitted | None:
    """Fit frames with this beam; None if it has no shape near them."""
    problems = problems_of(frames, shape)
    common = problems[0].mean[: problems[0].common].copy()
    if len(shape.widths) and not shape.widths.any():  # a prior
        common[problems[0].parameters["widths"]] = np.median([frame.taper for frame in frames])
    fit = fit_jointly(problems, common, np.array([frame.starts for frame in frames]))
    if fit is None:
        return None
    count = sum(len(problem.shared) for problem in problems)
    return Fitted(fit, fit.objective / count, problems)


class ChosenShape(NamedTuple):
    """What was learned with the chosen candidate, and the frames with errors that they share."""

    learned: LearnedShape | None
    frames: list[BentFrame]


def learn_chosen(frames: list[BentFrame], prior: BeamShape) -> ChosenShape:
    """Learn the chosen beam; what it does not explain, neighbouring points share."""
    first = fit_frames(frames, prior)
    if first is not None:
        frames = with_shared_errors(frames, prior, first.fit.frames)
    return ChosenShape(learn_shape(frames, prior), frames)


def exceeds(shape: BeamShape, stated: BeamShape) -> bool:
    """Test whether a learned taper or softness contradicts what the rig states of it."""
    taper = abs(shape.widths[0]) if len(shape.widths) else 0.0
    of_taper = stated.sigma(FIRST_WIDTH) if len(stated.widths) else math.inf
    of_clamp = stated.sigma(SOFTNESS) or math.inf
    return max(taper / of_taper, abs(shape.softness) / of_clamp) > _CONTRADICTION


def learn_shape(frames: Sequence[BentFrame], prior: BeamShape) -> LearnedShape | None:
    """Learn a beam from frames; residuals larger than stated widen its covariance."""
    result = fit_frames(frames, prior)
    if result is None:
        return None
    fit, misfit, problems = result
    indices = problems[0].parameters.indices("softness", "dx", "psi", "widths", "bow")
    values, side = fit.frames[0, indices], frames[0].measurement.handedness
    values[SKEW] -= side * (frames[0].measurement.rig.known_psi or 0.0)
    rest, length = frames[0].measurement.rest_bow, frames[0].measurement.rig.beam.length
    if rest is not None:
        values[FIRST_WIDTH + len(prior.widths) :] -= rest.by_weight / length
    covariance = np.zeros((len(indices), len(indices)))
    column = {int(parameter): i for i, parameter in enumerate(fit.shared)}
    # The clamp's position has errors of its own, which are not learned.
    held = [] if prior.covariance[CLAMP_SHIFT, CLAMP_SHIFT] else [CLAMP_SHIFT]
    values[held] = 0.0
    fitted = [i for i, p in enumerate(indices) if p in column and i not in held]
    rows = [column[indices[i]] for i in fitted]
    covariance[np.ix_(fitted, fitted)] = fit.covariance[np.ix_(rows, rows)] * max(misfit, 1.0)
    # Skew and bow are odd functions of the side to which the rig deflects.
    bow = FIRST_WIDTH + len(prior.widths)
    sides = np.ones(len(indices))
    sides[[SKEW, *range(bow, len(indices))]] = side
    values, covariance = values * sides, covariance * np.outer(sides, sides)
    friction = Friction(prior.friction_coefficient, prior.friction_sigma)
    if problems[0].rigid is not None:
        friction = _of_other_objects(problems[0].rigid.friction, fit, misfit)
    shape = replace(
        prior,
        widths=values[FIRST_WIDTH:bow],
        softness=float(values[SOFTNESS]),
        clamp_shift=float(values[CLAMP_SHIFT]),
        skew=float(values[SKEW]),
        bow=values[bow:],
        covariance=(covariance + covariance.T) / 2,
        friction_sigma=friction.sigma,
        friction_coefficient=friction.coefficient,
    )
    return LearnedShape(shape, misfit, fit.converged)


def _of_other_objects(stated: Friction, fit: JointFit, misfit: float) -> Friction:
    """Return the friction of other rigid objects, which are alike in part."""
    coefficient, sigma = stated
    of_mean = fit.friction_ratio_sigma * math.sqrt(max(misfit, 1.0))
    return Friction(
        max(coefficient + fit.friction_ratio, 0.0),
        math.hypot(of_mean, math.sqrt(1 - SHARED_VARIANCE_FRACTION) * sigma),
    )
