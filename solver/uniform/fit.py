"""Fit the exact beam to one frame, by the compiled functions."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.uniform.frame_fit import CHI2, ITERATIONS, STATUS, WIDENING, fit_robust
from solver.uniform.problem import Problem
from solver.uniform.residuals import PARAMETERS, TILT, point_residuals
from solver.uniform.starts import initial_estimate, workspace

# A numpy scalar is compiled once, a literal anew.
_PLANAR = np.bool_(False)


@dataclass(frozen=True)
class FrameFit:
    """Fit in units of the beam's length: `p` (8,) and `covariance` (8, 8) as in `residuals`.

    `status` is that of `minimise`; `chi2` is that of the `kept` points (n,) and the constraints;
    `covariance` is multiplied by `variance_inflation`, for residuals larger than stated and for
    correlated neighbours, and contains the errors that all points share.
    """

    p: Floats
    covariance: Floats
    status: int
    chi2: float
    kept: Any
    iterations: int
    variance_inflation: float


def start_of(problem: Problem, psi: float) -> Floats | None:
    """Estimate parameters (8,) near the minimum at this psi from a few points; None if it fails."""
    p = np.zeros(PARAMETERS)
    if not initial_estimate(problem.arrays, problem.shape_free, problem.tilt_variance, psi, p):
        return None
    return p


def fit_from(problem: Problem, start: Floats, psi_free: bool) -> FrameFit:
    """Fit from a start, robustly if the residuals require it."""
    p = start.copy()
    covariance, summary = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(4)
    sorted_inliers = np.ones(problem.points, dtype=np.bool_)
    free = problem.all_free if psi_free else problem.shape_free
    work = workspace(problem.points)
    fit_robust(
        p, problem.arrays, free, problem.tilt_variance, work, covariance, sorted_inliers, summary
    )
    covariance *= summary[WIDENING]
    if problem.shared_errors.shape[1]:
        moved = _moved_by(problem, p, covariance, sorted_inliers, summary[WIDENING])
        covariance += moved @ moved.T
    inliers = np.empty_like(sorted_inliers)
    inliers[problem.order] = sorted_inliers
    return FrameFit(
        p=p,
        covariance=covariance,
        status=int(summary[STATUS]),
        chi2=float(summary[CHI2]),
        kept=inliers,
        iterations=int(summary[ITERATIONS]),
        variance_inflation=float(summary[WIDENING]),
    )


def _moved_by(
    problem: Problem, p: Floats, covariance: Floats, inliers: Mask, inflation: float
) -> Floats:
    """Compute the displacement (8, k) of the fit's parameters by one sigma of each shared error.

    Least squares with gain G moves by G e where all points move by e: the covariance of an
    estimator that does not know of the errors, which is larger than the best one's.
    """
    points, view = problem.arrays.points, problem.arrays.viewpoint
    rows = np.zeros((TILT + 2, problem.points))
    point_residuals(p, points, view, _PLANAR, rows[-1], rows[:-1])
    # A shift along the sigma vector adds to the residual as much as it is, in sigmas.
    by_parameter = rows[:-1, inliers] @ problem.shared_errors[inliers]
    return np.asarray(covariance[:, : TILT + 1] / inflation @ by_parameter)
