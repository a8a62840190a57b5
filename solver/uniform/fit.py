"""Fit the exact beam to one frame in compiled code: start, least squares, outlier rejection.

The compiled functions have a `problem` of `FrameArrays`. Plain least squares comes first; its
result is kept if the residuals look like noise, so that robustness costs nothing in a clean frame.
Otherwise Tukey's weights with the stated sigmas are used, from two starts: the plain fit, and the
best of many exact beams through a few points each (MSAC; Torr and Zisserman 2000), which is robust
to outliers that agree with one another.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from solver.core.correlation import integrated_correlation
from solver.core.least_squares import CONVERGED, STOPPED
from solver.core.robust import VARIANCE_FACTOR, noise_chi2, scale
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Mask
from solver.instrument.medians import TUKEY_CUT
from solver.uniform.constraints import add_constraints
from solver.uniform.minimise import assemble, invert, linearise, minimise
from solver.uniform.problem import Problem
from solver.uniform.residuals import PARAMETERS, PSI, TILT, FrameArrays, point_residuals
from solver.uniform.starts import consensus, initial_estimate, workspace

# Maximum iterations at each wider cut, and of the final fit. A numpy scalar is compiled once, a
# literal for every value.
_WIDE_ITERATIONS, _FINAL_ITERATIONS = np.int64(10), np.int64(40)
_PLANAR, _WEIGHTED = np.bool_(False), np.bool_(True)
# Factors of the cut before it is reached. Chosen.
_WIDER: Final = (4.0, 2.0)


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
    return initial_estimate(problem.arrays, problem.shape_free, problem.tilt_variance, psi)


def fit_from(problem: Problem, start: Floats, psi_free: bool) -> FrameFit:
    """Fit from a start, robustly if the residuals require it."""
    free = problem.all_free if psi_free else problem.shape_free
    covariance, work = np.zeros((PARAMETERS, PARAMETERS)), workspace(problem.points)
    fit = _Fit(problem.arrays, free, problem.tilt_variance, work, covariance)
    p, residual, kept = start.copy(), work[0], np.ones(problem.points, dtype=np.bool_)
    status, chi2, iterations = fit.minimise(p, np.inf, _FINAL_ITERATIONS)
    dof = max(len(residual) - 2, 1)
    largest = np.abs(residual).max(initial=0.0)
    if chi2 > dof * noise_chi2(dof) or status == STOPPED or largest > THRESHOLDS.suspicious_sigmas:
        # Use the stated sigmas; larger ones only if most of the inliers' residuals require it.
        cut = TUKEY_CUT
        both = fit.robust_minimum(p, cut)
        if both is not None:
            p, status, _, iterations = both
            point_residuals(p, *problem.arrays[:2], _PLANAR, residual, work[1])
            inflation = scale(residual, THRESHOLDS.max_scale)
            if inflation > THRESHOLDS.min_scale:
                cut *= inflation
                status, _, extra = fit.minimise(p, cut, _FINAL_ITERATIONS)
                iterations += extra
        kept, chi2 = fit.inliers(p, cut)
        residual = residual[kept]
    inflation = variance_inflation(residual, chi2)
    covariance *= inflation
    if problem.shared_errors.shape[1]:
        moved = _moved_by(problem, p, covariance, kept, inflation)
        covariance += moved @ moved.T
    inliers = np.empty_like(kept)
    inliers[problem.order] = kept
    return FrameFit(p, covariance, int(status), float(chi2), inliers, int(iterations), inflation)


class _Minimum(NamedTuple):
    """Minimum p (8,) of a loss, how the iteration ended, its value, and iterations."""

    p: Floats
    status: int
    loss: float
    iterations: int


class _Fit(NamedTuple):
    """Compiled fit of a frame: its free parameters, workspace, and covariance (8, 8) to write."""

    arrays: FrameArrays
    free: Any
    tilt_variance: float
    work: Any
    covariance: Floats

    def minimise(self, p: Floats, cut: float, iterations: Any) -> Any:
        """Move p (8,) to the minimum; return (status, loss, iterations)."""
        return minimise(p, self.arrays, self.free, cut, iterations, self.work, self.covariance)

    def robust_minimum(self, p: Floats, cut: float) -> _Minimum | None:
        """Find the better of Tukey's minima near p and near the best beam of few points.

        Return None if there is no such beam.
        """
        second = p.copy()
        if not consensus(
            self.arrays, self.free, self.tilt_variance, p[PSI], cut, self.work, second
        ):
            return None
        one, other = self._graduated(p.copy(), cut), self._graduated(second, cut)
        better = one if _is_better(one, other) else other
        return better._replace(iterations=one.iterations + other.iterations)

    def _graduated(self, p: Floats, cut: float) -> _Minimum:
        """Minimise Tukey's loss from p, which is moved, with cuts down to `cut`."""
        total = 0
        for factor in _WIDER:
            _, _, iterations = self.minimise(p, factor * cut, _WIDE_ITERATIONS)
            total += iterations
        status, loss, iterations = self.minimise(p, cut, _FINAL_ITERATIONS)
        return _Minimum(p, status, loss, total + iterations)

    def inliers(self, p: Floats, cut: float) -> tuple[Mask, float]:
        """Find the points (n,) with a weight at p, and their chi2 with that of the constraints.

        The covariance is written, with Tukey's efficiency.
        """
        normal, gradient = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS)
        linearise(p, self.arrays, self.free, cut, self.work, normal, gradient)
        residual, _, weight, _ = self.work
        kept = np.abs(residual) < cut
        weight[:] = kept
        assemble(len(kept), self.free, _WEIGHTED, self.work, normal, gradient)
        chi2 = float(residual[kept] @ residual[kept])
        chi2 += add_constraints(p, self.arrays, normal, gradient)
        if invert(normal, self.free, self.covariance):
            self.covariance[:] *= VARIANCE_FACTOR
        return kept, chi2


def _is_better(one: _Minimum, other: _Minimum) -> bool:
    """Test whether a minimum is preferred: it converged, and its loss is not larger."""
    if one.status != CONVERGED:
        return False
    return other.status != CONVERGED or one.loss <= other.loss * (1 + 1e-6)


def _moved_by(
    problem: Problem, p: Floats, covariance: Floats, inliers: Mask, inflation: float
) -> Floats:
    """Compute the displacement (8, k) of the fit's parameters by one sigma of each shared error.

    Least squares with gain G moves by G e where all points move by e: the covariance of an
    estimator that ignores the errors, which is larger than the best one's.
    """
    points, view = problem.arrays.points, problem.arrays.viewpoint
    rows = np.zeros((TILT + 2, problem.points))
    point_residuals(p, points, view, _PLANAR, rows[-1], rows[:-1])
    # A shift along the sigma vector adds to the residual as much as it is, in sigmas.
    by_parameter = rows[:-1, inliers] @ problem.shared_errors[inliers]
    return np.asarray(covariance[:, : TILT + 1] / inflation @ by_parameter)


def variance_inflation(residual: Floats, chi2: float) -> float:
    """Compute the variance inflation, at least 1, of the covariance for independent errors.

    It is chi2 per degree of freedom times the correlation length of the residuals (n,). Each factor
    is used only where white noise reaches it in less than one frame of a thousand, and residuals
    smaller than stated never reduce the covariance.
    """
    dof = max(len(residual) - 2, 1)
    inflation = chi2 / dof
    if abs(inflation - 1) < 3 * math.sqrt(2 / dof):
        inflation = 1.0
    correlation = integrated_correlation(residual)
    if correlation > 1 + 6 / math.sqrt(dof):
        inflation *= correlation
    return float(max(inflation, 1.0))
