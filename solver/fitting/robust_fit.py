"""Fit a beam of changing section to one frame: a start, least squares, robust ones if needed.

The start is the uniform beam near the points. Plain least squares comes first; its result is kept
if the residuals look like noise. Otherwise Tukey's biweight is used, with a cut that decreases from
the scale of the residuals to that of the stated sigmas (graduated non-convexity; Blake and
Zisserman 1987): before the section is fitted, residuals are large everywhere, and no point may be
rejected for that.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from solver.beams.beam import S_C, Q
from solver.beams.exact import contact_at
from solver.core.least_squares import (
    CONVERGED,
    DEFICIENT,
    STOPPED,
    Block,
    Minimum,
    NormalEquations,
    Rows,
    minimise,
    normal_equations,
)
from solver.core.robust import VARIANCE_FACTOR, noise_chi2, scale, tukey
from solver.core.thresholds import THRESHOLDS
from solver.fitting.frame_problem import FrameProblem
from solver.instrument.arrays import Floats
from solver.instrument.medians import SIGMA_OVER_MAD, TUKEY_CUT
from solver.uniform import residuals
from solver.uniform.fit import FrameFit, start_of, variance_inflation
from solver.uniform.problem import Problem

# Largest number of times that the cut is reduced. Chosen: as often as it is halved from residuals
# of 500 sigmas; larger ones come from points of no beam, or from sigmas that are far too small.
_MOST_CUTS: Final = 9
# Largest contact arc length of a start, over the beam's length. Chosen: a uniform beam may be
# nearest to a thin tip with a contact beyond it.
_MAX_START: Final = 0.95


def robust_fit(problem: FrameProblem, start: Floats) -> FrameFit | None:
    """Fit from the parameters `start` (p,); return None if no beam has their shape.

    The result has the parameters of `beam_residuals`; fixed ones have no covariance. Points are in
    the order of `problem`.
    """
    first = _minimise(problem, start, np.inf)
    if first is None:
        return None
    at, status, iterations = first
    residual = at.rows[0].residual
    count = len(residual)
    dof = max(count - 2, 1)
    kept = np.ones(count, dtype=np.bool_)
    robust = (
        at.objective > dof * noise_chi2(dof)
        or np.abs(residual).max() > THRESHOLDS.suspicious_sigmas
    )
    if robust or status == STOPPED:
        cut = TUKEY_CUT
        largest = SIGMA_OVER_MAD * float(np.median(np.abs(residual)))
        halvings = max(math.ceil(math.log2(max(largest, 1.0))), 2)
        for power in np.linspace(halvings, 0, min(halvings, _MOST_CUTS) + 1):
            at, status, extra = _minimise(problem, at.p, 2.0**power * cut) or first
            iterations += extra
        inflation = scale(at.rows[0].residual, THRESHOLDS.max_scale)
        if inflation > THRESHOLDS.min_scale:
            cut *= inflation
            at, status, extra = _minimise(problem, at.p, cut) or first
            iterations += extra
        residual = at.rows[0].residual
        kept = np.abs(residual) < cut
        at = _system(
            problem, at.p, at.rows[0], kept.astype(float), float(residual[kept] @ residual[kept])
        )
    covariance = at.covariance()
    inflation = variance_inflation(np.ascontiguousarray(residual[kept]), at.objective)
    if covariance is None:
        status, covariance = DEFICIENT, np.zeros((len(at.p), len(at.p)))
    covariance *= inflation * (VARIANCE_FACTOR if robust else 1.0)
    return FrameFit(at.p, covariance, status, at.objective, kept, iterations, inflation)


def least_squares(problem: FrameProblem, start: Floats) -> NormalEquations | None:
    """Minimise the sum of squares from the parameters `start` (p,); return its equations there.

    Return None if no beam has the shape of the start, or if the iteration does not converge.
    """
    minimum = _minimise(problem, start, np.inf)
    if minimum is None or minimum.status != CONVERGED:
        return None
    at: NormalEquations = minimum.at
    return at


def _minimise(problem: FrameProblem, start: Floats, cut: float) -> Minimum | None:
    """Minimise with Tukey's weights, none for a cut of infinity; None if the start has no shape."""

    def system(p: Floats) -> NormalEquations | None:
        rows = residuals_at(problem, p)
        if rows is None:
            return None
        weight = np.ones(len(rows.residual))
        residual = rows.residual
        chi2 = tukey(residual, cut, weight) if cut < np.inf else residual @ residual
        return _system(problem, p, rows, weight, float(chi2))

    def moved(p: Floats, step: Floats) -> Floats | None:
        trial = problem.moved(p, step)
        return trial if all(0 < trial[i] < 2 * p[i] for i in problem.beam.positive) else None

    # A contact near the end of the curve, and the least width, are edges of the domain.
    return minimise(system, start, moved, at_edges=True)


def _system(
    problem: FrameProblem, p: Floats, rows: Rows, weight: Floats, chi2: float
) -> NormalEquations:
    block = Block(rows, np.arange(len(p)), weight, chi2)
    return normal_equations(p, problem.free, problem.mean, problem.information, (block,))


def residuals_at(problem: FrameProblem, p: Floats) -> Rows | None:
    """Compute residuals (n,) and their Jacobian (p, n) in sigmas; None if there is no shape."""
    count, own = len(problem.shared), len(p) - problem.shared.shape[1]
    residual, jacobian = np.empty(count), np.empty((len(p), count))
    exists = problem.residuals(p[:own], residual, jacobian[:own])
    jacobian[own:] = problem.shared.T
    residual += problem.shared @ p[own:]
    return Rows(residual, jacobian) if exists else None


def uniform_start(problem: Problem, model: FrameProblem, psi: float | None = None) -> Floats | None:
    """Return the parameters (p,) with load, place and clamp of a uniform beam near the points.

    Its inclination is `psi` [rad], or that of the prior. Return None if there is none.
    """
    at = model.parameters
    inclination = float(model.mean[at["psi"]]) if psi is None else psi
    uniform = start_of(_straightened(problem, model), inclination)
    if uniform is None:
        return None
    start = model.mean.copy()
    start[at["psi"]] = inclination
    start[Q] = uniform[residuals.Q]
    _, _, _, arc = contact_at(uniform[residuals.Q], uniform[residuals.LEVER])
    start[S_C] = min(arc[0], _MAX_START)
    start[at["dx"] : at["tilt"] + 1] = uniform[residuals.DX : residuals.TILT + 1]
    return start


def _straightened(problem: Problem, model: FrameProblem) -> Problem:
    """Remove the prior's bow from the points: a contact is no start for a beam bowed as far."""
    points = problem.arrays.points.copy()
    for power, coefficient in enumerate(model.mean[model.parameters.span("bow")], 2):
        points[residuals.Y] -= coefficient * points[residuals.X] ** power
    return replace(problem, arrays=problem.arrays._replace(points=points))
