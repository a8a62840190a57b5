"""Gauss-Newton for one frame on the normal equations of its few parameters, compiled."""

from typing import Any, Final

import numpy as np
from numba import njit

from solver.beam_models.exact import FAST
from solver.fitting.constraints import add_constraints
from solver.fitting.residuals import (
    LEVER,
    PARAMETERS,
    PSI,
    TILT,
    Q,
    point_residuals,
    possible,
)
from solver.fitting.robust import tukey
from solver.instrument.arrays import Floats

CONVERGED, STOPPED, DEFICIENT = range(3)
# The last step is that after which none longer than so many sigmas would follow: one shorter than
# that, or a short one where Gauss-Newton's quadratic convergence, as the step before shows it,
# leaves no more.
STEP_SIGMAS: Final = 1e-3
_SHORT: Final = 0.3
# Normal equations whose scaled pivots fall below this leave a direction open.
LEAST_PIVOT: Final = 1e-12
# Longest steps in q and lever (relative), psi and tilt [rad].
_REACH: Final = ((Q, 0.7), (LEVER, 0.5), (PSI, 0.4), (TILT, 0.3))


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _dot(a: Floats, b: Floats) -> float:
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _times(a: Floats, weight: Floats, out: Floats) -> None:
    for i in range(a.size):
        out[i] = a[i] * weight[i]


@njit(cache=True, error_model="numpy")
def linearise(
    p: Floats,
    problem: Any,
    free: Any,
    cut: float,
    work: Any,
    normal: Floats,
    gradient: Floats,
) -> float:
    """J^T W J (8, 8) and J^T W r (8,) at p, and the sum of squares, robust where `cut` is finite.

    `work` is residual (n,), Jacobian (6, n), weight (n,) and scratch (n,) of the points, or longer.
    """
    points, bounds, views, _, _, _ = problem
    residual, jacobian, weight, _ = work
    point_residuals(p, points, bounds, views, PSI in free, residual, jacobian)
    n = bounds[-1] - bounds[0]
    residual, weight = residual[:n], weight[:n]
    robust = cut < np.inf
    chi2 = tukey(residual, cut, weight) if robust else _dot(residual, residual)
    return chi2 + assemble(p, problem, free, robust, work, normal, gradient)


@njit(cache=True, error_model="numpy")
def assemble(
    p: Floats,
    problem: Any,
    free: Any,
    weighted: bool,
    work: Any,
    normal: Floats,
    gradient: Floats,
) -> float:
    """The normal equations of `work`, with all constraints; the constraints' sum of squares."""
    _, bounds, views, tips, known, base_whitening = problem
    residual, jacobian, weight, scratch = work
    n = bounds[-1] - bounds[0]
    residual, weight, scratch = residual[:n], weight[:n], scratch[:n]
    normal[:] = 0.0
    gradient[:] = 0.0
    for a in free:
        if a > TILT:
            continue
        column = jacobian[a, :n]
        if weighted:
            _times(column, weight, scratch)
            column = scratch
        gradient[a] = _dot(column, residual)
        for b in free:
            if b <= a:
                normal[a, b] = normal[b, a] = _dot(column, jacobian[b, :n])
    return add_constraints(p, views, tips, known, base_whitening, normal, gradient)


@njit(cache=True, error_model="numpy")
def _cholesky(matrix: Floats, lower: Floats) -> bool:
    """The lower triangular factor of a matrix with a unit diagonal; False if it is singular."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            if i > j:
                lower[i, j] = value / lower[j, j]
            elif value > LEAST_PIVOT:
                lower[i, i] = np.sqrt(value)
            else:
                return False
    return True


@njit(cache=True, error_model="numpy")
def invert(normal: Floats, free: Any, covariance: Floats) -> bool:
    """(J^T J)^-1 of the free parameters into `covariance` (8, 8), by Cholesky, columns scaled.

    False where a direction is left open.
    """
    n = len(free)
    covariance[:] = 0.0
    scale, matrix = np.empty(n), np.empty((n, n))
    lower, inverse = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        if not normal[free[i], free[i]] > 0:
            return False
        scale[i] = 1 / np.sqrt(normal[free[i], free[i]])
        for j in range(i + 1):
            matrix[i, j] = normal[free[i], free[j]] * scale[i] * scale[j]
    if not _cholesky(matrix, lower):
        return False
    for i in range(n):
        inverse[i, i] = 1 / lower[i, i]
        for j in range(i):
            inverse[i, j] = -_dot(lower[i, j:i], inverse[j:i, j]) * inverse[i, i]
    for i in range(n):
        for j in range(i + 1):
            value = _dot(inverse[i:, i], inverse[i:, j]) * scale[i] * scale[j]
            covariance[free[i], free[j]] = covariance[free[j], free[i]] = value
    return True


@njit(cache=True, error_model="numpy")
def _moved(p: Floats, step: Floats, share: float, views: Floats, to: Floats) -> None:
    """A share of the step from p.

    An image shows q cos(psi) - q (y_v / z_v) sin(psi) well and psi badly: where psi moves, that
    product takes its step and q follows, so that the curved valley of chi2 is walked along.
    """
    for a in range(PARAMETERS):
        to[a] = p[a] + share * step[a]
    if step[PSI] != 0:
        ray = views[0, 1]
        here = np.cos(p[PSI]) - ray * np.sin(p[PSI])
        there = np.cos(to[PSI]) - ray * np.sin(to[PSI])
        slope = -np.sin(p[PSI]) - ray * np.cos(p[PSI])
        if here > 0 and there > 0 and p[Q] > 0:
            gain = share * (step[Q] / p[Q] + slope / here * step[PSI])
            to[Q] = p[Q] * max(1 + gain, 0.1) * here / there


@njit(cache=True, error_model="numpy")
def minimise(
    p: Floats,
    problem: Any,
    free: Any,
    cut: float,
    most_iterations: Any,
    work: Any,
    covariance: Floats,
) -> Any:
    """From p, which is moved to the minimum: (status, chi2, iterations).

    `work` (see `linearise`) is left as it is within a third of a sigma of the minimum, and
    `covariance` (8, 8) is (J^T W J)^-1 there. `p` must be possible.
    """
    points, bounds, views, _, _, _ = problem
    normal, gradient = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS)
    step, trial = np.zeros(PARAMETERS), np.empty(PARAMETERS)
    chi2 = linearise(p, problem, free, cut, work, normal, gradient)
    iteration, before = 0, 0.0
    while iteration < most_iterations:
        iteration += 1
        if not invert(normal, free, covariance):
            return DEFICIENT, chi2, iteration
        length2 = 0.0
        for a in free:
            step[a] = 0.0
            for b in free:
                step[a] -= covariance[a, b] * gradient[b]
            length2 -= step[a] * gradient[a]
        share = 1.0
        for parameter, reach in _REACH:
            allowed = reach * p[parameter] if parameter <= LEVER else reach
            if abs(step[parameter]) > allowed:
                share = min(share, allowed / abs(step[parameter]))
        length = np.sqrt(max(length2, 0.0))
        last = length < STEP_SIGMAS or (length < _SHORT and length**3 < STEP_SIGMAS * before**2)
        before = length if share == 1.0 else 0.0
        if share == 1.0 and last:
            _moved(p, step, share, views, trial)
            if possible(trial, points, bounds, views):
                p[:] = trial
            return CONVERGED, chi2 - length2, iteration
        moved = False
        for _ in range(10):
            _moved(p, step, share, views, trial)
            if possible(trial, points, bounds, views):
                there = linearise(trial, problem, free, cut, work, normal, gradient)
                # Sigmas follow the shape, so that a short step may gain nothing and still be right.
                if there <= chi2 * (1 + 1e-9) or (length2 < 1 and share == 1.0):
                    moved = True
                    break
            share /= 2
        if not moved:
            chi2 = linearise(p, problem, free, cut, work, normal, gradient)
            return STOPPED, chi2, iteration
        p[:] = trial
        chi2 = there
    return STOPPED, chi2, iteration
