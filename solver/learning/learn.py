"""Learn the beam and its clamp from pushes against unknown objects at unknown places.

The simplest beam is chosen that predicts pushes which it was not learned from as well as the best
one (cross-validation; Stone 1974), within the error of their difference. Images alone determine the
shape of EI along the beam, not its scale.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.special import stdtrit

from solver.beam_models.rod import S_C, WIDTHS
from solver.fitting.rod_joint import JointFit, fit_jointly
from solver.fitting.rod_problem import ALIKE, RodProblem
from solver.fitting.rod_residuals import DX, PSI, SOFTNESS
from solver.fitting.thresholds import LIMITS
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import CLAMP_SHIFT, FIRST_WIDTH, SKEW, BeamShape, Friction
from solver.instrument.beam_shape import SOFTNESS as SOFT
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig
from solver.learning.candidates import Candidate, candidates_of, prior_of
from solver.learning.clamp_offset import LearnedOffset, ObjectRadius, learn_clamp_offset
from solver.learning.next_push import NextForce, NextPush, next_force, next_push
from solver.learning.pushes import BentFrame, bent_frame, problems_of, with_shared_errors

# Fewest pushes: one to learn from and one to predict. Parts of the cross-validation. Chosen.
MIN_PUSHES: Final = 2
_PARTS: Final = 5
# Misfit of a candidate that has no shape near the frames. Chosen: far above any other.
_UNFITTED: Final = 1e12
# Sigmas beyond which a taper or softness is not that which the rig states.
_CONTRADICTION: Final = 3.0
# Probability that a difference is within two standard errors, below which a simpler beam is as good
# as the best one. Chosen.
_WITHIN: Final = 0.9545


@dataclass(frozen=True)
class Trial:
    """How well a candidate predicts pushes that it was not learned from.

    `pushes` (n,) are the mean squares of the residuals [sigma] of each push; `excess` is their mean
    above that of the best candidate, with its standard error. `noise` is the excess that three
    sigmas of one parameter cause, for residuals as correlated as they are.
    """

    candidate: Candidate
    pushes: Floats
    excess: float
    excess_error: float
    noise: float

    @property
    def misfit(self) -> float:
        """Mean over the pushes."""
        return float(self.pushes.mean())


@dataclass(frozen=True)
class LearnedBeam:
    """A learned beam, the candidates that were compared, and the frames that it was learned from.

    `frames` of the `measured` ones show one contact, and were used; `misfit` is the mean square of
    the residuals [sigma] of all of them. `next_push` would determine
    best what they have left uncertain; it is None if nothing is. `next_force`, were it
    known, would determine EI best; it is None if EI is known well. `offset` is the clamp's from the
    motor's axis; it is None if the pushes do not show it.
    """

    shape: BeamShape
    chosen: Candidate
    trials: tuple[Trial, ...]
    frames: int
    measured: int
    misfit: float
    next_push: NextPush | None = None
    next_force: NextForce | None = None
    offset: LearnedOffset | None = None

    def rig(self, rig: Rig) -> Rig:
        """Return the rig with what was learned of it."""
        if self.offset is None or not self.offset.used:
            return replace(rig, shape=self.shape)
        return replace(rig, shape=self.shape, clamp_offset=self.offset.offset)


def learn_beam(
    pushes: Sequence[Sequence[Measurement]], radius: ObjectRadius | None = None
) -> LearnedBeam:
    """Learn the beam of a rig from the measurements of its pushes, whose order does not matter.

    `radius` is that of all objects, as `learn_clamp_offset` needs it. Raises InputError if fewer
    than two pushes show a contact, or no beam fits them.
    """
    frames = _bent_pushes(pushes)
    if len(frames) < MIN_PUSHES:
        raise InputError(
            f"{len(frames)} of {len(pushes)} pushes show a contact, needed are {MIN_PUSHES} to "
            "learn the beam"
        )
    stated = _rig(pushes).shape
    trials = _compare(frames, stated)
    chosen, bent = _simplest(trials), [frame for push in frames for frame in push]
    learned, every = _learn_last(bent, prior_of(chosen, stated))
    if chosen.stated and (learned is None or _exceeds(learned.shape, stated)):
        chosen = chosen._replace(stated=False)
        learned, every = _learn_last(bent, prior_of(chosen, stated))
    if learned is None or not learned.converged:
        raise InputError("no beam fits the pushes: are they of one beam, with one contact each?")
    correlation = float(np.mean([frame.correlation for frame in every]))
    problem, rig = problems_of(every[:1], learned.shape)[0], _rig(pushes)
    rigidity = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
    return LearnedBeam(
        shape=learned.shape,
        chosen=chosen,
        trials=trials,
        frames=len(every),
        measured=sum(map(len, pushes)),
        misfit=learned.misfit,
        next_push=next_push(problem, correlation, chosen.shifted),
        next_force=next_force(
            problem, correlation, math.hypot(rigidity, learned.shape.rigidity_sigma)
        ),
        offset=learn_clamp_offset(pushes, replace(rig, shape=learned.shape), radius),
    )


@dataclass(frozen=True)
class _Learned:
    shape: BeamShape
    misfit: float
    converged: bool


def _rig(pushes: Sequence[Sequence[Measurement]]) -> Rig:
    return next(measurement for push in pushes for measurement in push).rig


def _bent_pushes(pushes: Sequence[Sequence[Measurement]]) -> list[list[BentFrame]]:
    """Return the bent frames of the pushes that have any."""
    prior = _of_single_frames(_rig(pushes).shape) if any(pushes) else BeamShape()
    bent = [[bent_frame(measurement, prior) for measurement in push] for push in pushes]
    present = [[frame for frame in push if frame is not None] for push in bent]
    return [push for push in present if push]


def _of_single_frames(stated: BeamShape) -> BeamShape:
    """Return the prior of the frames' own fits, whose residuals show outliers.

    It is a cone. Where the clamp may be elsewhere it is one that gives, which looks the same.
    """
    return prior_of(Candidate(1, soft=bool(stated.sigma(CLAMP_SHIFT))), stated)


def _compare(pushes: Sequence[Sequence[BentFrame]], stated: BeamShape) -> tuple[Trial, ...]:
    """Predict every push with every candidate, learned from the other parts of the pushes."""
    parts = _parts(pushes)
    candidates = candidates_of(stated)
    misfits = np.full((len(candidates), len(pushes)), _UNFITTED)
    for row, candidate in enumerate(candidates):
        prior = prior_of(candidate, stated)
        for part in set(parts.tolist()):
            others = [frame for i, push in enumerate(pushes) if parts[i] != part for frame in push]
            learned = _learn(others, prior)
            if learned is not None and _impossible(learned.shape):
                learned = None
            for i in np.flatnonzero(parts == part).tolist():
                predicted = None if learned is None else _fit(pushes[i], learned.shape)
                if predicted is not None:
                    misfits[row, i] = predicted.misfit
    excess = misfits - misfits[int(np.argmin(misfits.mean(axis=1)))]
    frames = [frame for push in pushes for frame in push]
    correlation = float(np.mean([frame.correlation for frame in frames]))
    noise = LIMITS.close_chi2 * correlation / sum(int(frame.inliers.sum()) for frame in frames)
    error = excess.std(axis=1, ddof=1) / np.sqrt(len(pushes))
    return tuple(
        Trial(candidate, misfits[i], float(excess[i].mean()), float(error[i]), noise)
        for i, candidate in enumerate(candidates)
    )


def _impossible(shape: BeamShape) -> bool:
    """Test whether the clamp would turn against its moment: the beam begins beyond it instead."""
    alone = not shape.sigma(CLAMP_SHIFT)
    return alone and shape.softness < -LIMITS.impossible_sigmas * shape.sigma(SOFT)


def _parts(pushes: Sequence[Sequence[BentFrame]]) -> Floats:
    """Divide pushes (n,) by their places along the beam: neighbours are in the same part.

    The errors of a centreline follow the pixel grid, and are the same in a repeated push.
    """
    places = [float(np.median([frame.starts[-1, S_C] for frame in push])) for push in pushes]
    ranks = np.argsort(np.argsort(places))
    return np.asarray(ranks * min(_PARTS, len(pushes)) // len(pushes))


def _simplest(trials: Sequence[Trial]) -> Candidate:
    """Return the first candidate that is as good as the best, within the noise.

    A uniform beam on a rigid clamp, of which the rig states that it is certain, is left only where
    it does not predict the pushes within the stated sigmas: errors that pushes share could prefer
    another beam, by little.
    """
    first = trials[0]
    if not first.candidate.size and first.pushes.max() <= 1:
        return first.candidate
    # The standard errors are those of a few pushes (Student 1908).
    errors = float(stdtrit(len(trials[0].pushes) - 1, (1 + _WITHIN) / 2))
    return next(
        trial.candidate
        for trial in trials
        if trial.excess <= max(errors * trial.excess_error, trial.noise)
    )


class _Fitted(NamedTuple):
    """Joint fit of frames, the mean square of their residuals [sigma], and their problems."""

    fit: JointFit
    misfit: float
    problems: list[RodProblem]


def _fit(frames: Sequence[BentFrame], shape: BeamShape) -> _Fitted | None:
    """Fit frames with this beam; None if it has no shape near them."""
    problems = problems_of(frames, shape)
    common = problems[0].mean[: problems[0].common].copy()
    if len(shape.widths) and not shape.widths.any():  # a prior
        common[WIDTHS] = np.median([frame.taper for frame in frames])
    fit = fit_jointly(problems, common, np.array([frame.starts for frame in frames]))
    if fit is None:
        return None
    count = sum(len(problem.shared) for problem in problems)
    return _Fitted(fit, fit.objective / count, problems)


class _Last(NamedTuple):
    """What was learned with the chosen candidate, and the frames with errors that they share."""

    learned: _Learned | None
    frames: list[BentFrame]


def _learn_last(frames: list[BentFrame], prior: BeamShape) -> _Last:
    """Learn the chosen beam; what it does not explain, neighbouring points share."""
    first = _fit(frames, prior)
    if first is not None:
        frames = with_shared_errors(frames, prior, first.fit.frames)
    return _Last(_learn(frames, prior), frames)


def _exceeds(shape: BeamShape, stated: BeamShape) -> bool:
    """Test whether a learned taper or softness contradicts what the rig states of it."""
    taper = abs(shape.widths[0]) if len(shape.widths) else 0.0
    of_taper = stated.sigma(FIRST_WIDTH) if len(stated.widths) else math.inf
    of_clamp = stated.sigma(SOFT) or math.inf
    return max(taper / of_taper, abs(shape.softness) / of_clamp) > _CONTRADICTION


def _learn(frames: Sequence[BentFrame], prior: BeamShape) -> _Learned | None:
    """Learn a beam from frames; residuals larger than stated widen its covariance."""
    result = _fit(frames, prior)
    if result is None:
        return None
    fit, misfit, problems = result
    size = problems[0].shape_size
    indices = [size + SOFTNESS, size + DX, size + PSI, *range(WIDTHS, size)]
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
    friction = _friction(prior, fit, misfit)
    shape = BeamShape(
        widths=values[FIRST_WIDTH:bow],
        softness=float(values[0]),
        clamp_shift=float(values[CLAMP_SHIFT]),
        skew=float(values[SKEW]),
        bow=values[bow:],
        covariance=(covariance + covariance.T) / 2,
        section_sigma=prior.section_sigma,
        rigidity_sigma=prior.rigidity_sigma,
        friction_sigma=friction.sigma if prior.rigid_objects else prior.friction_sigma,
        rigid_objects=prior.rigid_objects,
        bow_sigma=prior.bow_sigma,
        friction_coefficient=friction.coefficient if prior.rigid_objects else 0.0,
    )
    return _Learned(shape, misfit, fit.converged)


def _friction(prior: BeamShape, fit: JointFit, misfit: float) -> Friction:
    """Return the friction of other rigid objects, which are alike in part."""
    coefficient, sigma = prior.friction
    of_mean = fit.grip_sigma * math.sqrt(max(misfit, 1.0))
    return Friction(
        max(coefficient + fit.grip, 0.0), math.hypot(of_mean, math.sqrt(1 - ALIKE) * sigma)
    )
