"""Fit the exact beam to one frame in compiled code: start, least squares, outlier rejection.

A `problem` is a `FrameArrays`. Plain least squares comes first; its result is kept if
the residuals look like noise, so that robustness costs nothing in a clean frame. Otherwise Tukey's
weights with the stated sigmas are used, from two starts: the plain fit, and the best of many
exact beams through a few points each (MSAC; Torr and Zisserman 2000), which is robust to outliers
that agree with one another.
"""

import math
from typing import Any

import numpy as np

from solver.core.correlation import integrated_correlation
from solver.core.least_squares import CONVERGED, STOPPED
from solver.core.robust import VARIANCE_FACTOR, scale
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, copy_into
from solver.instrument.compiled import interpreted, njit
from solver.instrument.medians import TUKEY_CUT
from solver.uniform.constraints import add_constraints
from solver.uniform.minimise import (
    assemble,
    invert,
    linearise,
    minimise,
)
from solver.uniform.residuals import PARAMETERS, PSI, point_residuals
from solver.uniform.starts import consensus

# Maximum iterations at each wider cut, and of the final fit. A numpy scalar is compiled once, a
# literal for every value.
_WIDE_ITERATIONS, _FINAL_ITERATIONS = np.int64(10), np.int64(40)
_PLANAR, _WEIGHTED = np.bool_(False), np.bool_(True)
# Entries of `summary`.
STATUS, CHI2, ITERATIONS, WIDENING = range(4)


@interpreted
def _minimise_tukey(
    p: Floats, problem: Any, free: Any, cut: float, work: Any, covariance: Floats
) -> Any:
    """Minimise Tukey's loss from p, with cuts down to `cut`; return (status, cost, iterations)."""
    total = 0
    for factor in (4.0, 2.0):
        _, _, iterations = minimise(
            p, problem, free, factor * cut, _WIDE_ITERATIONS, work, covariance
        )
        total += iterations
    status, cost, iterations = minimise(p, problem, free, cut, _FINAL_ITERATIONS, work, covariance)
    return status, cost, total + iterations


@interpreted
def _minimise_both(
    p: Floats, second_p: Floats, problem: Any, free: Any, cut: float, work: Any, covariance: Floats
) -> Any:
    """Write the better of Tukey's minima near p and `second_p` to p; return status, iterations."""
    first_p = p.copy()
    first_status, first_cost, first_iterations = _minimise_tukey(
        first_p, problem, free, cut, work, covariance
    )
    status, cost, iterations = _minimise_tukey(second_p, problem, free, cut, work, covariance)
    if first_status == CONVERGED and (first_cost <= cost * (1 + 1e-6) or status != CONVERGED):
        status, second_p = first_status, first_p
    copy_into(p, second_p)
    return status, first_iterations + iterations


@njit
def _exceed(residual: Floats, limit: float) -> bool:
    """Test whether a residual (n,) is larger than the limit; a loop without an exit is faster."""
    count = 0
    for r in residual:
        count += abs(r) > limit
    return count > 0


@interpreted
def fit_robust(
    p: Floats,
    problem: Any,
    free: Any,
    tilt_variance: float,
    work: Any,
    covariance: Floats,
    inliers: Any,
    summary: Floats,
) -> None:
    """Fit from the start p, robustly if the residuals require it.

    Writes `covariance` (8, 8), `inliers` (n,), which points have a weight, and `summary` (4,):
    status, chi2 of the inliers and the constraints, iterations, and the variance inflation, by
    which the covariance is not yet multiplied.
    """
    points, view = problem.points, problem.viewpoint
    residual = work[0][: points.shape[1]]
    status, chi2, iterations = minimise(
        p, problem, free, np.inf, _FINAL_ITERATIONS, work, covariance
    )
    inliers[:] = True
    dof = max(len(residual) - 2, 1)
    # Six sigmas of chi2 detect a run of outliers that has biased the least-squares fit.
    limit = dof * (1 + 6 * math.sqrt(2 / dof))
    if chi2 > limit or status == STOPPED or _exceed(residual, THRESHOLDS.suspicious_sigmas):
        # Use the stated sigmas; larger ones only if most of the inliers' residuals require it.
        cut = TUKEY_CUT
        second_start = p.copy()
        if consensus(problem, free, tilt_variance, p[PSI], cut, work, second_start):
            status, iterations = _minimise_both(
                p, second_start, problem, free, cut, work, covariance
            )
            point_residuals(p, points, view, _PLANAR, residual, work[1])
            inflation = scale(residual, THRESHOLDS.max_scale)
            if inflation > THRESHOLDS.min_scale:
                cut = TUKEY_CUT * inflation
                status, _, extra = minimise(
                    p, problem, free, cut, _FINAL_ITERATIONS, work, covariance
                )
                iterations += extra
        chi2 = _mark_inliers(p, problem, free, cut, work, covariance, inliers)
        residual = residual[inliers]
    summary[STATUS], summary[CHI2], summary[ITERATIONS] = status, chi2, iterations
    summary[WIDENING] = variance_inflation(residual, chi2)


@njit
def _mark_inliers(
    p: Floats, problem: Any, free: Any, cut: float, work: Any, covariance: Floats, inliers: Any
) -> float:
    """Mark the points with a weight at p, compute the covariance by Tukey's efficiency and chi2."""
    normal, gradient = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS)
    linearise(p, problem, free, cut, work, normal, gradient)
    residual, _, weight, _ = work
    chi2 = 0.0
    for i in range(len(inliers)):
        inliers[i] = abs(residual[i]) < cut
        weight[i] = 1.0 if inliers[i] else 0.0
        chi2 += weight[i] * residual[i] ** 2
    assemble(len(inliers), free, _WEIGHTED, work, normal, gradient)
    chi2 += add_constraints(p, problem, normal, gradient)
    if invert(normal, free, covariance):
        covariance *= VARIANCE_FACTOR
    return chi2


@njit
def variance_inflation(residual: Floats, chi2: float) -> float:
    """Compute the variance inflation, at least 1, of the covariance for independent errors.

    It is chi2 per degree of freedom times the correlation length of the residuals. Each factor is
    used only where white noise reaches it in less than one frame of a thousand, and residuals
    smaller than stated never reduce the covariance.
    """
    dof = max(len(residual) - 2, 1)
    inflation = chi2 / dof
    if abs(inflation - 1) < 3 * np.sqrt(2 / dof):
        inflation = 1.0
    correlation = integrated_correlation(residual)
    if correlation > 1 + 6 / np.sqrt(dof):
        inflation *= correlation
    return max(inflation, 1.0)
