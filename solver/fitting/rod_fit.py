"""Fit a beam of changing section to one frame: least squares, robust where residuals require it.

Plain least squares comes first; its result is kept if the residuals look like noise. Otherwise
Tukey's biweight is used, with a cut that decreases from the scale of the residuals to that of the
stated sigmas (graduated non-convexity; Blake and Zisserman 1987): before the section is fitted,
residuals are large everywhere, and no point may be rejected for that.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.fitting.fit import FrameFit
from solver.fitting.frame_fit import variance_inflation
from solver.fitting.minimise import CONVERGED, DEFICIENT, STOPPED
from solver.fitting.robust import MEDIAN, VARIANCE_FACTOR, scale, tukey
from solver.fitting.rod_problem import RodProblem
from solver.fitting.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats

_MAX_ITERATIONS: Final = 100
# Levenberg and Marquardt's damping after a step that failed for the first time, and its factor.
# Chosen.
_FIRST_DAMPING, _FACTOR = 1e-6, 10.0
_MAX_DAMPING: Final = 1e6
# Largest number of times that the cut is reduced. Chosen: as often as it is halved from residuals
# of 500 sigmas; larger ones come from points of no beam, or from sigmas that are far too small.
_MOST_CUTS: Final = 9
# Length of a step [sigma] that is near the minimum. Chosen: there the objective hardly changes.
_NEAR: Final = 5.0
# Parts of a step that are tried before it is damped. Chosen: a shorter one is no faster than a
# damped one.
_PARTS: Final = (1.0, 0.5, 0.25, 0.125, 0.0625)


class LeastSquares(NamedTuple):
    """Parameters `p` (p,) at a minimum, and the sum of squares there with the prior."""

    p: Floats
    objective: float


class _Linearised(NamedTuple):
    """Objective at p, its half gradient (f,) and normal matrix (f, f) by the free parameters.

    `step` (f,) is that of Gauss and Newton, of this `length` in sigmas. It is empty where a
    direction is undetermined.
    """

    p: Floats
    residual: Floats
    jacobian: Floats
    weight: Floats
    objective: float
    gradient: Floats
    normal: Floats
    step: Floats
    length: float


class _Minimum(NamedTuple):
    at: _Linearised
    status: int
    iterations: int


def fit_rod(problem: RodProblem, start: Floats) -> FrameFit | None:
    """Fit from the parameters `start` (p,); return None if no beam has their shape.

    The result has the parameters of `rod_residuals`; fixed ones have no covariance. Points are in
    the order of `problem`.
    """
    first = _minimise(problem, start, np.inf)
    if first is None:
        return None
    at, status, iterations = first
    residual, count = at.residual, len(at.residual)
    dof = max(count - 2, 1)
    # As in `frame_fit`: six sigmas of chi2 detect a run of outliers that has biased the fit.
    limit = dof * (1 + 6 * math.sqrt(2 / dof))
    kept = np.ones(count, dtype=np.bool_)
    robust = at.objective > limit or np.abs(residual).max() > THRESHOLDS.suspicious_sigmas
    if robust or status == STOPPED:
        cut = THRESHOLDS.tukey_cut
        largest = float(np.median(np.abs(residual))) / MEDIAN
        halvings = max(math.ceil(math.log2(max(largest, 1.0))), 2)
        for power in np.linspace(halvings, 0, min(halvings, _MOST_CUTS) + 1):
            at, status, extra = _minimise(problem, at.p, 2.0**power * cut) or first
            iterations += extra
        inflation = scale(at.residual, THRESHOLDS.max_scale)
        if inflation > THRESHOLDS.min_scale:
            cut *= inflation
            at, status, extra = _minimise(problem, at.p, cut) or first
            iterations += extra
        kept = np.abs(at.residual) < cut
        at = _weighted(problem, at, kept.astype(float))
    inverse = _inverse(at.normal)
    covariance = np.zeros((len(at.p), len(at.p)))
    inflation = variance_inflation(np.ascontiguousarray(at.residual[kept]), at.objective)
    if inverse is None:
        status = DEFICIENT
    else:
        efficiency = VARIANCE_FACTOR if robust else 1.0
        covariance[np.ix_(problem.free, problem.free)] = inverse * (efficiency * inflation)
    return FrameFit(at.p, covariance, status, at.objective, kept, iterations, inflation)


def least_squares(problem: RodProblem, start: Floats) -> LeastSquares | None:
    """Minimise the sum of squares from the parameters `start` (p,).

    Return None if no beam has the shape of the start, or if the iteration does not converge.
    """
    minimum = _minimise(problem, start, np.inf)
    if minimum is None or minimum.status != CONVERGED:
        return None
    return LeastSquares(minimum.at.p, minimum.at.objective)


def _minimise(problem: RodProblem, start: Floats, cut: float) -> _Minimum | None:
    """Minimise by damped Gauss-Newton steps; return None if the start has no shape."""
    at = _linearised(problem, start, cut)
    if at is None:
        return None
    damping = 0.0
    for iteration in range(1, _MAX_ITERATIONS + 1):
        if not len(at.step):
            return _Minimum(at, DEFICIENT, iteration)
        length = at.length
        if damping == 0:
            moved = _moved(problem, at, cut)
        else:
            # Where rounding hides a decrease, only strongly damped, short steps are accepted.
            step = _solved(at.normal, at.gradient, damping)
            length = math.sqrt(max(float(-step @ at.gradient), 0.0))
            moved = _damped(problem, at, step, cut)
        if moved is not None:
            at, damping = moved, damping / _FACTOR if damping > _FIRST_DAMPING else 0.0
            if length < THRESHOLDS.step_sigmas:
                return _Minimum(at, CONVERGED, iteration)
        else:
            damping = max(damping * _FACTOR, _FIRST_DAMPING)
            if damping > _MAX_DAMPING:
                break
    return _Minimum(at, STOPPED, iteration)


def _moved(problem: RodProblem, at: _Linearised, cut: float) -> _Linearised | None:
    """Return where the largest part of a step leads that is better; None if none is.

    Near the minimum, where the objective hardly changes, a part is better if the next step is
    shorter, or if the objective falls by at least a quarter of what is expected.
    """
    for part in _PARTS:
        moved = _after(problem, at, part * at.step, cut)
        if moved is None:
            continue
        shorter = moved.length < (1 - part / 4) * at.length or at.length < THRESHOLDS.step_sigmas
        better = moved.objective <= at.objective - part * at.length**2 / 4
        if shorter or better if at.length < _NEAR else moved.objective <= at.objective * (1 + 1e-9):
            return moved
    return None


def _damped(problem: RodProblem, at: _Linearised, step: Floats, cut: float) -> _Linearised | None:
    """Return where a damped step leads; None if that is not better."""
    moved = _after(problem, at, step, cut)
    better = moved is not None and moved.objective <= at.objective * (1 + 1e-9)
    return moved if better else None


def _solved(normal: Floats, gradient: Floats, damping: float = 0.0) -> Floats:
    """Solve the damped normal equations for a step (f,); it is empty where they are singular."""
    unit = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(unit, unit)
    scaled[np.diag_indices_from(scaled)] += damping
    try:
        return np.asarray(-np.linalg.solve(scaled, gradient / unit) / unit)
    except np.linalg.LinAlgError:
        return np.empty(0)


def _after(problem: RodProblem, at: _Linearised, step: Floats, cut: float) -> _Linearised | None:
    """Return where a step (f,) leads; None where no beam has the shape, or where it is too long."""
    change = np.zeros_like(at.p)
    change[problem.free] = step
    trial = problem.moved(at.p, change)
    if not all(0 < trial[i] < 2 * at.p[i] for i in problem.positive):
        return None
    # A wild step may lead beyond the range of numbers.
    with np.errstate(over="ignore", invalid="ignore"):
        moved = _linearised(problem, trial, cut)
    return moved if moved is not None and np.isfinite(moved.normal).all() else None


def residuals_at(problem: RodProblem, p: Floats) -> tuple[Floats, Floats] | None:
    """Compute residuals (n,) and their Jacobian (p, n) in sigmas; None if there is no shape."""
    count, own = len(problem.shared), len(p) - problem.shared.shape[1]
    residual, jacobian = np.empty(count), np.empty((len(p), count))
    exists = problem.residuals(p[:own], residual, jacobian[:own])
    jacobian[own:] = problem.shared.T
    residual += problem.shared @ p[own:]
    return (residual, jacobian) if exists else None


def _linearised(problem: RodProblem, p: Floats, cut: float) -> _Linearised | None:
    rows = residuals_at(problem, p)
    if rows is None:
        return None
    residual, jacobian = rows
    weight = np.ones(len(residual))
    chi2 = float(tukey(residual, cut, weight) if cut < np.inf else residual @ residual)
    return _with_prior(problem, p, residual, jacobian[problem.free], weight, chi2)


def _weighted(problem: RodProblem, at: _Linearised, weight: Floats) -> _Linearised:
    """Return the least-squares problem of points with these weights (n,)."""
    chi2 = float(weight @ at.residual**2)
    return _with_prior(problem, at.p, at.residual, at.jacobian, weight, chi2)


def _with_prior(
    problem: RodProblem, p: Floats, residual: Floats, jacobian: Floats, weight: Floats, chi2: float
) -> _Linearised:
    weighted = jacobian * weight
    pull = problem.information @ (p - problem.mean)
    gradient = weighted @ residual + pull[problem.free]
    normal = weighted @ jacobian.T + problem.information[np.ix_(problem.free, problem.free)]
    step = _solved(normal, gradient)
    length = math.sqrt(max(float(-step @ gradient), 0.0)) if len(step) else math.nan
    objective = chi2 + float((p - problem.mean) @ pull)
    return _Linearised(p, residual, jacobian, weight, objective, gradient, normal, step, length)


def _inverse(normal: Floats) -> Floats | None:
    """Invert normal equations; None if they do not determine a direction."""
    unit = np.sqrt(np.diag(normal))
    if not (unit > 0).all():
        return None
    scaled = normal / np.outer(unit, unit)
    if np.linalg.eigvalsh(scaled)[0] < THRESHOLDS.min_pivot:
        return None
    return np.asarray(np.linalg.inv(scaled) / np.outer(unit, unit))
