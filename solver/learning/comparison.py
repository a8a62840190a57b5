"""Compare beams by how well each predicts pushes that it was not learned from.

Cross-validation (Stone 1974). The simplest beam is chosen that is as good as the best one, within
the error of their difference.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtrit

from solver.beams.beam import S_C
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import CLAMP_SHIFT, SOFTNESS, BeamShape
from solver.learning.candidates import Candidate, candidates_of, prior_of
from solver.learning.pushes import BentFrame
from solver.learning.shape import fit_frames, learn_shape

# Parts of the cross-validation. Chosen.
_PARTS: Final = 5
# Misfit of a candidate that has no shape near the frames. Chosen: far above any other.
_UNFITTED: Final = 1e12
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


def compare(pushes: Sequence[Sequence[BentFrame]], stated: BeamShape) -> tuple[Trial, ...]:
    """Predict every push with every candidate, learned from the other parts of the pushes."""
    parts = _parts(pushes)
    candidates = candidates_of(stated)
    misfits = np.full((len(candidates), len(pushes)), _UNFITTED)
    for row, candidate in enumerate(candidates):
        prior = prior_of(candidate, stated)
        for part in set(parts.tolist()):
            others = [frame for i, push in enumerate(pushes) if parts[i] != part for frame in push]
            learned = learn_shape(others, prior)
            if learned is not None and _impossible(learned.shape):
                learned = None
            for i in np.flatnonzero(parts == part).tolist():
                predicted = None if learned is None else fit_frames(pushes[i], learned.shape)
                if predicted is not None:
                    misfits[row, i] = predicted.misfit
    excess = misfits - misfits[int(np.argmin(misfits.mean(axis=1)))]
    frames = [frame for push in pushes for frame in push]
    correlation = float(np.mean([frame.correlation for frame in frames]))
    noise = THRESHOLDS.close_chi2 * correlation / sum(int(frame.inliers.sum()) for frame in frames)
    error = excess.std(axis=1, ddof=1) / np.sqrt(len(pushes))
    return tuple(
        Trial(candidate, misfits[i], float(excess[i].mean()), float(error[i]), noise)
        for i, candidate in enumerate(candidates)
    )


def _impossible(shape: BeamShape) -> bool:
    """Test whether the clamp would turn against its moment: the beam begins beyond it instead."""
    alone = not shape.sigma(CLAMP_SHIFT)
    return alone and shape.softness < -THRESHOLDS.impossible_sigmas * shape.sigma(SOFTNESS)


def _parts(pushes: Sequence[Sequence[BentFrame]]) -> Floats:
    """Divide pushes (n,) by their places along the beam: neighbours are in the same part.

    The errors of a centreline follow the pixel grid, and are the same in a repeated push.
    """
    places = [float(np.median([frame.starts[-1, S_C] for frame in push])) for push in pushes]
    ranks = np.argsort(np.argsort(places))
    return np.asarray(ranks * min(_PARTS, len(pushes)) // len(pushes))


def simplest(trials: Sequence[Trial]) -> Candidate:
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
