"""Joint least squares of photographs that share a beam, a lens and the direction of gravity."""

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from solver.beam_models.rod import S_C, Q
from solver.core.least_squares import MIN_PIVOT
from solver.instrument.arrays import Floats
from solver.photographs.problem import OWN, PhotoProblem

_MAX_ITERATIONS: Final = 50
# Levenberg and Marquardt's damping: the first, its factor after a step that failed, its limits.
# Chosen: the valleys are narrow, with curvatures that differ by nine orders of magnitude.
_FIRST_DAMPING, _FACTOR = 1e-6, 10.0
_LEAST_DAMPING, _MAX_DAMPING = 1e-12, 1e6
# Increase of the objective that is accepted. Derived: sigmas depend on the view, so the steps lead
# to a point that is near to the minimum, a tenth of a sigma at most.
_TOLERANCE: Final = 0.01
# Undamped step [sigma] after which the fit has converged. Chosen: far below what noise moves.
_STEP_SIGMAS: Final = 0.01
# Places of a load that a step may lead to, over the length. Chosen: a load at the tip may have an
# estimate beyond it, and the curve ends at 1.05.
_PLACES: Final = (0.01, 1.045)


@dataclass(frozen=True)
class JointProblem:
    """Photographs and the prior of all parameters: the shared ones, then those of each photograph.

    `mean` (p,) and `information` (p, p) are the prior; `free` (f,) are the indices of the
    parameters that are fitted. `weights` are those of each photograph's points (n,), divided by
    what its variances are larger by than stated.
    """

    photos: tuple[PhotoProblem, ...]
    mean: Floats
    information: Floats
    free: Any
    weights: tuple[Floats, ...]

    @property
    def shared(self) -> int:
        """Number of shared parameters."""
        return len(self.mean) - OWN * len(self.photos)

    def columns(self, photo: int) -> list[int]:
        """Indices of the parameters of one photograph: the shared ones and its own."""
        first = self.shared + OWN * photo
        return [*range(self.shared), *range(first, first + OWN)]


class System(NamedTuple):
    """Sum of squares at p, its half gradient (f,) and normal matrix (f, f) of free parameters.

    `residuals` are those of each photograph (n,), without weights.
    """

    p: Floats
    objective: float
    gradient: Floats
    normal: Floats
    residuals: tuple[Floats, ...]


class Minimum(NamedTuple):
    """System at the minimum, and whether the iteration has converged."""

    at: System
    converged: bool


def system_of(problem: JointProblem, p: Floats) -> System | None:
    """Linearise at p; None if no beam or no view has these parameters."""
    # Trial values may overflow.
    with np.errstate(all="ignore"):
        return _linearised(problem, p)


def _linearised(problem: JointProblem, p: Floats) -> System | None:
    pull = problem.information @ (p - problem.mean)
    objective, gradient, normal = float((p - problem.mean) @ pull), pull, problem.information.copy()
    residuals = []
    for i, (photo, weights) in enumerate(zip(problem.photos, problem.weights, strict=True)):
        columns = problem.columns(i)
        rows = photo.rows(p[columns])
        if rows is None:
            return None
        weight = np.concatenate([weights, np.ones(len(rows.residual) - len(weights))])
        weighted = rows.jacobian * weight[:, None]
        objective += float(weight @ rows.residual**2)
        gradient[columns] += weighted.T @ rows.residual
        normal[np.ix_(columns, columns)] += weighted.T @ rows.jacobian
        residuals.append(rows.residual)
    if not np.isfinite(objective):
        return None
    free = problem.free
    return System(p, objective, gradient[free], normal[np.ix_(free, free)], tuple(residuals))


def minimise(problem: JointProblem, start: Floats) -> Minimum | None:
    """Minimise by damped Gauss-Newton steps; None if no beam or view has the start's parameters."""
    at = system_of(problem, start)
    if at is None:
        return None
    damping = _FIRST_DAMPING
    for _ in range(_MAX_ITERATIONS):
        moved, length = _step(problem, at, damping)
        if moved is not None and moved.objective <= at.objective + _TOLERANCE:
            at, damping = moved, max(damping / _FACTOR, _LEAST_DAMPING)
            if length < _STEP_SIGMAS:
                return Minimum(at, converged=True)
        else:
            damping *= _FACTOR
            if damping > _MAX_DAMPING:
                break
    return Minimum(at, converged=False)


def covariance_of(problem: JointProblem, at: System) -> Floats | None:
    """Invert the normal matrix: (p, p), zero for fixed parameters; None if it is singular."""
    unit = np.sqrt(np.maximum(np.diag(at.normal), 1e-300))
    scaled = at.normal / np.outer(unit, unit)
    if not np.isfinite(scaled).all() or np.linalg.eigvalsh(scaled)[0] < MIN_PIVOT:
        return None
    covariance = np.zeros_like(problem.information)
    block = np.ix_(problem.free, problem.free)
    covariance[block] = np.linalg.inv(scaled) / np.outer(unit, unit)
    return covariance


def _step(problem: JointProblem, at: System, damping: float) -> tuple[System | None, float]:
    """Take a damped step; return where it leads, and the length [sigma] of the undamped step.

    The first is None where no beam or no view has the parameters.
    """
    unit = np.sqrt(np.maximum(np.diag(at.normal), 1e-300))
    scaled = at.normal / np.outer(unit, unit)
    values, vectors = np.linalg.eigh(scaled)
    pull = vectors.T @ (at.gradient / unit)
    values = np.maximum(values, _LEAST_DAMPING)
    length = float(np.sqrt((pull**2 / values).sum()))
    step = -vectors @ (pull / (values + damping)) / unit
    full_step = np.zeros_like(at.p)
    full_step[problem.free] = step
    return system_of(problem, _moved(problem, at.p, full_step)), length


def _moved(problem: JointProblem, p: Floats, step: Floats) -> Floats:
    """Return the parameters (p,) after a step (p,), in which loads stay on the beam."""
    moved = p + step
    for i, photo in enumerate(problem.photos):
        columns, own = np.array(problem.columns(i)), problem.shared
        q, place = columns[own + Q], columns[own + S_C]
        # A load stays positive, and at most doubles.
        moved[q] = np.clip(moved[q], p[q] / 10, 2 * p[q])
        moved[place] = np.clip(moved[place], *_PLACES)
        with np.errstate(all="ignore"):
            moved[columns[own:]] = photo.moved(p[columns], (moved - p)[columns])[own:]
    return moved
