"""Fit one frame by Gauss-Newton on the normal equations of its parameters, compiled."""

from typing import Any, Final

import numpy as np

from solver.core.least_squares import (
    CONVERGED,
    DEFICIENT,
    MIN_PIVOT,
    STEP_SIGMAS,
    STOPPED,
)
from solver.core.robust import tukey
from solver.instrument.arrays import Floats, copy_into
from solver.instrument.compiled import FAST, njit
from solver.instrument.small_matrices import dot
from solver.uniform.constraints import add_constraints
from solver.uniform.in_plane_c import plane_equations
from solver.uniform.residuals import (
    LEVER,
    PARAMETERS,
    PSI,
    TILT,
    Q,
    is_feasible,
    point_residuals,
)

# A fit has also converged after a step shorter than this many sigmas if Gauss-Newton's quadratic
# convergence, estimated from the step before, predicts that the next step is short enough.
_SHORT: Final = 0.3
# Longest steps in q and lever (relative), psi and tilt [rad].
_MAX_STEPS: Final = ((Q, 0.7), (LEVER, 0.5), (PSI, 0.4), (TILT, 0.3))


@njit(fastmath=FAST)
def _multiply(a: Floats, weight: Floats, out: Floats) -> None:
    for i in range(a.size):
        out[i] = a[i] * weight[i]


@njit
def linearise(
    p: Floats,
    problem: Any,
    free: Any,
    cut: float,
    work: Any,
    normal: Floats,
    gradient: Floats,
) -> float:
    """Compute J^T W J (8, 8), J^T W r (8,), sum of squares at p, robust where `cut` is finite.

    `work` is residual (n,), Jacobian (6, n), weight (n,) and scratch (n,) of the points, or longer;
    a plain fit in plane C uses only the residual.
    """
    points, view = problem.points, problem.viewpoint
    residual, jacobian, weight, _ = work
    n = points.shape[1]
    residual, weight = residual[:n], weight[:n]
    spatial, robust = PSI in free, cut < np.inf
    if p[PSI] == 0 and not spatial and not robust:
        chi2 = plane_equations(p, points, residual, normal, gradient)
    else:
        point_residuals(p, points, view, spatial, residual, jacobian)
        chi2 = tukey(residual, cut, weight) if robust else dot(residual, residual)
        assemble(n, free, robust, work, normal, gradient)
    return chi2 + add_constraints(p, problem, normal, gradient)


@njit
def assemble(n: Any, free: Any, weighted: Any, work: Any, normal: Floats, gradient: Floats) -> None:
    """Assemble the normal equations of n points from `work`."""
    residual, jacobian, weight, scratch = work
    residual, weight, scratch = residual[:n], weight[:n], scratch[:n]
    normal[:] = 0.0
    gradient[:] = 0.0
    for a in free:
        if a > TILT:
            continue
        column = jacobian[a, :n]
        if weighted:
            _multiply(column, weight, scratch)
            column = scratch
        gradient[a] = dot(column, residual)
        for b in free:
            if b <= a:
                normal[a, b] = normal[b, a] = dot(column, jacobian[b, :n])


@njit
def invert(normal: Floats, free: Any, covariance: Floats) -> bool:
    """Write (J^T J)^-1 of the free parameters to `covariance` (8, 8) by Gauss-Jordan elimination.

    Returns False if a direction is undetermined. A positive definite matrix needs no row exchange.
    """
    covariance[:] = 0.0
    for a in free:
        for b in free:
            covariance[a, b] = normal[a, b]
    for k in free:
        # Information about this parameter if those before it are unknown too.
        pivot = covariance[k, k]
        if not pivot > MIN_PIVOT * normal[k, k]:
            return False
        covariance[k, k] = 1.0
        for b in range(PARAMETERS):
            covariance[k, b] /= pivot
        for a in free:
            if a != k:
                factor = covariance[a, k]
                covariance[a, k] = 0.0
                for b in range(PARAMETERS):
                    covariance[a, b] -= factor * covariance[k, b]
    return True


@njit
def _take_step(p: Floats, step: Floats, fraction: float, view: Floats, target: Floats) -> None:
    """Write p plus a fraction of the step to `target`.

    An image determines q cos(psi) - q (y_v / z_v) sin(psi) well and psi badly. If psi changes, the
    step is applied to that product and q follows from it, so that the iterates follow the curved
    valley of chi2.
    """
    for a in range(PARAMETERS):
        target[a] = p[a] + fraction * step[a]
    if step[PSI] != 0:
        ray = view[1]
        factor = np.cos(p[PSI]) - ray * np.sin(p[PSI])
        target_factor = np.cos(target[PSI]) - ray * np.sin(target[PSI])
        slope = -np.sin(p[PSI]) - ray * np.cos(p[PSI])
        if factor > 0 and target_factor > 0 and p[Q] > 0:
            gain = fraction * (step[Q] / p[Q] + slope / factor * step[PSI])
            target[Q] = p[Q] * max(1 + gain, 0.1) * factor / target_factor


@njit
def minimise(
    p: Floats,
    problem: Any,
    free: Any,
    cut: float,
    max_iterations: Any,
    work: Any,
    covariance: Floats,
) -> Any:
    """Minimise from p, which is moved to the minimum; return (status, chi2, iterations).

    The residual in `work` (see `linearise`) is evaluated within a third of a sigma of the minimum,
    and `covariance` (8, 8) is (J^T W J)^-1 there. `p` must be feasible (`is_feasible`).
    """
    points, view = problem.points, problem.viewpoint
    normal, gradient = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS)
    step, trial = np.zeros(PARAMETERS), np.empty(PARAMETERS)
    chi2 = linearise(p, problem, free, cut, work, normal, gradient)
    iteration, previous_length = 0, 0.0
    while iteration < max_iterations:
        iteration += 1
        if not invert(normal, free, covariance):
            return DEFICIENT, chi2, iteration
        length2 = 0.0
        for a in free:
            step[a] = 0.0
            for b in free:
                step[a] -= covariance[a, b] * gradient[b]
            length2 -= step[a] * gradient[a]
        fraction = 1.0
        for parameter, limit in _MAX_STEPS:
            max_step = limit * p[parameter] if parameter <= LEVER else limit
            if abs(step[parameter]) > max_step:
                fraction = min(fraction, max_step / abs(step[parameter]))
        length = np.sqrt(max(length2, 0.0))
        last = length < STEP_SIGMAS or (
            length < _SHORT and length**3 < STEP_SIGMAS * previous_length**2
        )
        previous_length = length if fraction == 1.0 else 0.0
        if fraction == 1.0 and last:
            _take_step(p, step, fraction, view, trial)
            if is_feasible(trial, points, view):
                copy_into(p, trial)
            return CONVERGED, chi2 - length2, iteration
        accepted = False
        for _ in range(10):
            _take_step(p, step, fraction, view, trial)
            if is_feasible(trial, points, view):
                trial_chi2 = linearise(trial, problem, free, cut, work, normal, gradient)
                # Sigmas depend on the shape, so a short step may be right without reducing chi2.
                if trial_chi2 <= chi2 * (1 + 1e-9) or (length2 < 1 and fraction == 1.0):
                    accepted = True
                    break
            fraction /= 2
        if not accepted:
            chi2 = linearise(p, problem, free, cut, work, normal, gradient)
            return STOPPED, chi2, iteration
        copy_into(p, trial)
        chi2 = trial_chi2
    return STOPPED, chi2, iteration
