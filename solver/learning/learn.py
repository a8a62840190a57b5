"""Learn the beam and its clamp from pushes against unknown objects at unknown places.

The simplest beam is chosen that predicts pushes which it was not learned from as well as the best
one (cross-validation; Stone 1974), within the error of their difference. Images alone determine the
shape of EI along the beam, not its scale.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver.instrument.beam_shape import CLAMP_SHIFT, BeamShape
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig
from solver.learning.candidates import Candidate, prior_of
from solver.learning.clamp_offset import LearnedOffset, ObjectRadius, learn_clamp_offset
from solver.learning.comparison import Trial, compare, simplest
from solver.learning.next_push import NextForce, NextPush, next_force, next_push
from solver.learning.pushes import BentFrame, bent_frame, problems_of
from solver.learning.shape import exceeds, learn_chosen

# Fewest pushes: one to learn from and one to predict. Chosen.
MIN_PUSHES: Final = 2


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
    trials = compare(frames, stated)
    chosen, bent = simplest(trials), [frame for push in frames for frame in push]
    learned, every = learn_chosen(bent, prior_of(chosen, stated))
    if chosen.stated and (learned is None or exceeds(learned.shape, stated)):
        chosen = chosen._replace(stated=False)
        learned, every = learn_chosen(bent, prior_of(chosen, stated))
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

    It is a cone. Where the clamp may be elsewhere it is compliant, which looks the same.
    """
    return prior_of(Candidate(1, soft=bool(stated.sigma(CLAMP_SHIFT))), stated)
