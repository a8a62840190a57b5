"""Learn a beam from pushes: one least-squares fit of all frames, whose beam and clamp are shared.

Every frame has its own contact, force and friction ratio. Width, clamp, plane of bending and the
errors that all points share are the same in all frames, so that contacts at several places
determine what one image does not. The frames' own parameters (Schur complement) and errors of their
own are eliminated, so that the size of the joint system is that of the shared ones.

The objects of one rig may be alike, and all contacts slide the same way while the motor pushes on,
or in the direction that the problem states: the friction ratios have a common mean, which is one
more shared parameter. Were they independent, many frames of the same friction would be taken for a
bend of the beam.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.core.least_squares import CONVERGED, BorderedEquations, minimise
from solver.fitting.frame_problem import SHARED_VARIANCE_FRACTION, FrameProblem
from solver.fitting.robust_fit import residuals_at
from solver.instrument.arrays import Floats

# Parameters of each frame's own; all others are shared.
OWN: Final = (Q, S_C, FRICTION_RATIO)
# Chosen: along a curved valley, as where a clamp may give or hold farther in, steps shrink by 5 %
# each; 60 did not reach its bottom in one of twenty cases.
_MAX_ITERATIONS: Final = 200
# Step [sigma] after which the fit has converged. Chosen: far below what noise moves.
_STEP_SIGMAS: Final = 0.01


@dataclass(frozen=True)
class JointFit:
    """Fit of n frames: `frames` (n, c) are their parameters, `covariance` (s, s) of the shared.

    `shared` (s,) are the indices of the shared parameters that were fitted; `friction_ratio` and
    `friction_ratio_sigma` are the mean of the friction ratios, beyond that of their priors;
    `objective` is the sum of squares of all points and priors.
    """

    frames: Floats
    shared: Floats
    covariance: Floats
    friction_ratio: float
    friction_ratio_sigma: float
    objective: float
    converged: bool


def fit_jointly(
    problems: Sequence[FrameProblem], common: Floats, starts: Floats
) -> JointFit | None:
    """Fit n frames of one beam.

    The shared parameters start from those of `common` (c,), each frame's own from the best of its
    `starts` (n, a, 3), in the order of OWN. What is shared may differ by known amounts, those of
    the priors' means: `common` is that of the first frame. Return None if no start of a frame has a
    shape.
    """
    first = problems[0]
    free = first.free[first.free < first.common]
    own = np.array([i for i in free if i in OWN])
    shared = np.array([i for i in free if i not in OWN])
    nearest = [
        _nearest(problem, common + _apart(problem, first), start[:, own], own)
        for problem, start in zip(problems, starts, strict=True)
    ]
    parameters = np.array([start for start in nearest if start is not None])
    if len(parameters) < len(problems):
        return None
    joint = JointProblem(problems, parameters, own, shared)
    # As for one frame, the domain's edge may be the end.
    found = minimise(
        joint.system,
        joint.start,
        step_sigmas=_STEP_SIGMAS,
        max_iterations=_MAX_ITERATIONS,
        at_edges=True,
    )
    if found is None:
        return None
    covariance = found.at.shared_covariance()
    if covariance is None:
        return None
    return JointFit(
        frames=joint.frames(found.at.p),
        shared=shared,
        covariance=covariance[:-1, :-1],
        friction_ratio=float(found.at.p[len(shared)]),
        friction_ratio_sigma=math.sqrt(covariance[-1, -1]),
        objective=found.at.objective,
        converged=found.status == CONVERGED,
    )


def _apart(problem: FrameProblem, first: FrameProblem) -> Floats:
    """Return the difference (c,) between the priors of a frame and of the first one."""
    return problem.mean[: problem.common] - first.mean[: first.common]


def _nearest(problem: FrameProblem, common: Floats, starts: Floats, own: Floats) -> Floats | None:
    """Return `common` with the start (o,) of the smallest residuals; None if none has a shape."""
    best, smallest = None, math.inf
    for start in starts:
        trial = common.copy()
        trial[own] = start
        rows = _rows(problem, trial)
        size = math.inf if rows is None else float(rows[-1] @ rows[-1])
        if size < smallest:
            best, smallest = trial, size
    return best


def _rows(problem: FrameProblem, p: Floats) -> Floats | None:
    """Compute the Jacobian by the common parameters p (c,), and the residuals: rows (c + 1, n).

    Errors of the frame's own are eliminated. Return None if there is no shape.
    """
    rows = residuals_at(problem, np.append(p, np.zeros(problem.own_errors)))
    if rows is None:
        return None
    return problem.without_own_errors(np.vstack([rows[1][: problem.common], rows[0]]))


@dataclass(frozen=True)
class JointProblem:
    """Problems of n frames, and which of their parameters are the frames' `own` and `shared` ones.

    The parameters p of the joint fit are the shared ones (s,), the mean friction ratio, and then
    the own ones (n, o). `first` (n, c) are the frames' parameters at its start.
    """

    problems: Sequence[FrameProblem]
    first: Floats
    own: Floats
    shared: Floats

    @property
    def start(self) -> Floats:
        """Start of the joint fit, without a mean friction ratio."""
        return np.concatenate([self.first[0, self.shared], [0.0], self.first[:, self.own].ravel()])

    def frames(self, p: Floats) -> Floats:
        """Return the frames' parameters (n, c), which differ by what their priors do."""
        frames, s = self.first.copy(), len(self.shared)
        frames[:, self.shared] += p[:s] - self.first[0, self.shared]
        frames[:, self.own] = p[s + 1 :].reshape(len(frames), -1)
        return frames

    def system(self, p: Floats) -> BorderedEquations | None:
        """Compute the normal equations; None where a frame has no shape."""
        own, shared = self.own, self.shared
        n, s, first = len(self.problems), len(shared), self.problems[0]
        parameters, friction_ratio = self.frames(p), float(p[s])
        if (parameters[:, [Q, S_C]] <= 0).any():
            return None
        own_blocks = np.empty((n, len(own), len(own)))
        mixed = np.zeros((n, len(own), s + 1))
        own_gradient = np.empty((n, len(own)))
        # The prior of the shared parameters counts once.
        shared_block, deviation = np.zeros((s + 1, s + 1)), np.zeros(s + 1)
        shared_block[:s, :s] = first.information[np.ix_(shared, shared)]
        deviation[:s] = p[:s] - first.mean[shared]
        # Without friction, its mean is 0 and has no effect.
        known = max(one.information[FRICTION_RATIO, FRICTION_RATIO] for one in self.problems)
        shared_block[s, s] = max(known, 1.0) / SHARED_VARIANCE_FRACTION
        deviation[s] = friction_ratio
        shared_gradient = shared_block @ deviation
        objective = float(deviation @ shared_gradient)
        friction = np.flatnonzero(own == FRICTION_RATIO)
        for i, problem in enumerate(self.problems):
            rows = _rows(problem, parameters[i])
            if rows is None:
                return None
            residual, jacobian = rows[-1], rows[:-1]
            by_own, by_shared = jacobian[own], jacobian[shared]
            prior = problem.information[np.ix_(own, own)]
            sign = problem.friction_sign
            prior[friction, friction] /= 1 - SHARED_VARIANCE_FRACTION * sign**2
            pull = parameters[i, own] - problem.mean[own]
            pull[friction] -= sign * friction_ratio
            own_blocks[i] = by_own @ by_own.T + prior
            mixed[i, :, :s] = by_own @ by_shared.T
            mixed[i, friction, s] = -sign * prior[friction, friction]
            own_gradient[i] = by_own @ residual + prior @ pull
            shared_block[:s, :s] += by_shared @ by_shared.T
            shared_block[s, s] += sign**2 * prior[friction, friction].sum()
            shared_gradient[:s] += by_shared @ residual
            shared_gradient[s] -= sign * (prior[friction, friction] * pull[friction]).sum()
            objective += float(residual @ residual + pull @ prior @ pull)
        return BorderedEquations(
            p, objective, shared_block, own_blocks, mixed, shared_gradient, own_gradient
        )
