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
from typing import Final, NamedTuple

import numpy as np

from solver.beam_models.rod import FRICTION_RATIO, S_C, Q
from solver.fitting.rod_fit import residuals_at
from solver.fitting.rod_problem import SHARED_VARIANCE_FRACTION, RodProblem
from solver.instrument.arrays import Floats

# Parameters of each frame's own; all others are shared.
OWN: Final = (Q, S_C, FRICTION_RATIO)
# Chosen: along a curved valley, as where a clamp may give or hold farther in, steps shrink by 5 %
# each; 60 did not reach its bottom in one of twenty cases.
_MAX_ITERATIONS: Final = 200
_FIRST_DAMPING: Final = 1e-6
_FACTOR: Final = 10.0
_MAX_DAMPING: Final = 1e6
# Step [sigma] after which the fit has converged. Chosen: far below what noise moves.
_STEP_SIGMAS: Final = 0.01
# Share of a parameter's information that is rounding, where the elimination of the frames' own
# parameters leaves no more. Derived: differences of numbers with 16 digits, of squares.
_ROUNDING: Final = 1e-12


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


class _System(NamedTuple):
    """Normal equations at `parameters` (n, c): own blocks (n, o, o), mixed (n, o, s + 1), shared.

    The last shared parameter is the mean friction ratio, `friction_ratio`.
    """

    parameters: Floats
    friction_ratio: float
    objective: float
    own: Floats
    mixed: Floats
    shared: Floats
    own_gradient: Floats
    shared_gradient: Floats


def fit_jointly(problems: Sequence[RodProblem], common: Floats, starts: Floats) -> JointFit | None:
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
    at = _system(problems, parameters, 0.0, own, shared)
    if at is None:
        return None
    damping, converged = 0.0, False
    for _ in range(_MAX_ITERATIONS):
        moved, length = _step(problems, at, own, shared, damping)
        if moved is not None and damping == 0 and moved.objective > at.objective:
            # As in `rod_fit`: the valley is curved, and the next step leads back to its bottom.
            moved, _ = _step(problems, moved, own, shared, 0.0)
        if moved is not None and moved.objective <= at.objective * (1 + 1e-9):
            at, damping = moved, damping / _FACTOR if damping > _FIRST_DAMPING else 0.0
            if length < _STEP_SIGMAS:
                converged = True
                break
        else:
            damping = max(damping * _FACTOR, _FIRST_DAMPING)
            if damping > _MAX_DAMPING:
                break
    covariance = _covariance(at)
    return JointFit(
        frames=at.parameters,
        shared=shared,
        covariance=covariance[:-1, :-1],
        friction_ratio=at.friction_ratio,
        friction_ratio_sigma=math.sqrt(covariance[-1, -1]),
        objective=at.objective,
        converged=converged,
    )


def _apart(problem: RodProblem, first: RodProblem) -> Floats:
    """Return the difference (c,) between the priors of a frame and of the first one."""
    return problem.mean[: problem.common] - first.mean[: first.common]


def _nearest(problem: RodProblem, common: Floats, starts: Floats, own: Floats) -> Floats | None:
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


def _rows(problem: RodProblem, p: Floats) -> Floats | None:
    """Compute the Jacobian by the common parameters p (c,), and the residuals: rows (c + 1, n).

    Errors of the frame's own are eliminated. Return None if there is no shape.
    """
    rows = residuals_at(problem, np.append(p, np.zeros(problem.own_errors)))
    if rows is None:
        return None
    return problem.without_own_errors(np.vstack([rows[1][: problem.common], rows[0]]))


def _system(
    problems: Sequence[RodProblem],
    parameters: Floats,
    friction_ratio: float,
    own: Floats,
    shared: Floats,
) -> _System | None:
    n, s, first = len(problems), len(shared), problems[0]
    if (parameters[:, [Q, S_C]] <= 0).any():
        return None
    own_blocks = np.empty((n, len(own), len(own)))
    mixed = np.zeros((n, len(own), s + 1))
    own_gradient = np.empty((n, len(own)))
    # The prior of the shared parameters counts once.
    shared_block, deviation = np.zeros((s + 1, s + 1)), np.zeros(s + 1)
    shared_block[:s, :s] = first.information[np.ix_(shared, shared)]
    deviation[:s] = parameters[0, shared] - first.mean[shared]
    # Without friction, its mean is 0 and has no effect.
    known = max(problem.information[FRICTION_RATIO, FRICTION_RATIO] for problem in problems)
    shared_block[s, s] = max(known, 1.0) / SHARED_VARIANCE_FRACTION
    deviation[s] = friction_ratio
    shared_gradient = shared_block @ deviation
    objective = float(deviation @ shared_gradient)
    friction = np.flatnonzero(own == FRICTION_RATIO)
    for i, problem in enumerate(problems):
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
    return _System(
        parameters,
        friction_ratio,
        objective,
        own_blocks,
        mixed,
        shared_block,
        own_gradient,
        shared_gradient,
    )


def _reduced(at: _System, damping: float) -> tuple[Floats, Floats, Floats]:
    """Eliminate the frames' own parameters: reduced matrix (s, s), gradient, inverse own blocks."""
    own = at.own.copy()
    diagonal = np.arange(own.shape[1])
    own[:, diagonal, diagonal] *= 1 + damping
    inverse = np.linalg.inv(own)
    matrix = at.shared - np.einsum("nos,nop,npt->st", at.mixed, inverse, at.mixed)
    matrix[np.diag_indices_from(matrix)] += damping * np.diag(at.shared)
    gradient = at.shared_gradient - np.einsum("nos,nop,np->s", at.mixed, inverse, at.own_gradient)
    return (matrix + matrix.T) / 2, gradient, np.asarray(inverse, dtype=np.float64)


def _covariance(at: _System) -> Floats:
    """Invert the reduced matrix; a direction of which only rounding is left has a large sigma."""
    unit = np.sqrt(np.diag(at.shared))
    values, vectors = np.linalg.eigh(_reduced(at, 0.0)[0] / np.outer(unit, unit))
    inverse = (vectors / np.maximum(values, _ROUNDING)) @ vectors.T
    return np.asarray(inverse / np.outer(unit, unit))


def _step(
    problems: Sequence[RodProblem], at: _System, own: Floats, shared: Floats, damping: float
) -> tuple[_System | None, float]:
    """Take a damped step; return where it leads, None if nowhere, and its length in sigmas."""
    matrix, gradient, inverse = _reduced(at, damping)
    unit = np.sqrt(np.diag(at.shared))
    step_shared = -np.linalg.solve(matrix / np.outer(unit, unit), gradient / unit) / unit
    right = at.own_gradient + at.mixed @ step_shared
    step_own = -np.einsum("nop,np->no", inverse, right)
    decrease = -(step_shared @ at.shared_gradient) - float((step_own * at.own_gradient).sum())
    trial = at.parameters.copy()
    trial[:, own] += step_own
    trial[:, shared] += step_shared[:-1]
    moved = _system(problems, trial, at.friction_ratio + float(step_shared[-1]), own, shared)
    return moved, math.sqrt(max(float(decrease), 0.0))
