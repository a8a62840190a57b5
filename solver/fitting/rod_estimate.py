"""Estimate from one frame of a beam that is not uniform, or not known to be."""

from dataclasses import replace
from typing import Final

import numpy as np

from solver.beam_models.exact import contact_at
from solver.beam_models.rod import S_C, Q
from solver.fitting import residuals
from solver.fitting.fit import FrameFit, start_of
from solver.fitting.fit_estimate import estimate_from_fit, refusal_of
from solver.fitting.problem import Problem, problem_of
from solver.fitting.rod_fit import fit_rod
from solver.fitting.rod_problem import RodProblem, rod_problem_of
from solver.fitting.rod_residuals import DX, PSI, TILT
from solver.fitting.rod_values import rod_values
from solver.fitting.thresholds import LIMITS
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

# Largest contact arc length of a start, over the beam's length. Chosen: a uniform beam may be
# nearest to a thin tip with a contact beyond it.
_MAX_START: Final = 0.95


def rod_estimate(measurement: Measurement) -> Estimate:
    """Estimate contact and force in the known plane, with the rig's stated or learned beam.

    What one image does not determine (section, friction, clamp) has the prior that the rig states,
    and widens the covariance accordingly.
    """
    bowed = with_bow(measurement)
    problem = problem_of(bowed, with_tips=False)
    rod = rod_problem_of(bowed, problem)
    fit = fit_frame(problem, rod) if problem.points >= LIMITS.min_points else None
    refusal = refusal_of(measurement, problem, fit)
    if refusal is not None or fit is None:
        return refusal or Estimate(Outcome.NOT_CONVERGED)
    values, covariance = rod_values(measurement, rod, fit)
    return estimate_from_fit(measurement, problem, fit, values, covariance)


def with_bow(measurement: Measurement) -> Measurement:
    """Return the measurement with the bow that was removed from its points."""
    if measurement.rest_bow is None:
        return measurement
    view = measurement.view
    points = view.points + measurement.rest_bow.removed
    return replace(measurement, view=replace(view, points=points))


def fit_frame(problem: Problem, rod: RodProblem) -> FrameFit | None:
    """Fit a frame from the start of a uniform beam; None if no beam is near the points.

    The fit's `kept` (n,) is in the order of the measurement's points.
    """
    start = uniform_start(problem, rod)
    fit = None if start is None else fit_rod(rod, start)
    if fit is None:
        return None
    kept = np.empty_like(fit.kept)
    kept[problem.order] = fit.kept
    return replace(fit, kept=kept)


def uniform_start(problem: Problem, rod: RodProblem) -> Floats | None:
    """Return the parameters (p,) with load, place and clamp of a uniform beam near the points.

    Return None if there is none.
    """
    size = rod.shape_size
    uniform = start_of(problem, float(rod.mean[size + PSI]))
    if uniform is None:
        return None
    start = rod.mean.copy()
    start[Q] = uniform[residuals.Q]
    _, _, _, arc = contact_at(uniform[residuals.Q], uniform[residuals.LEVER])
    start[S_C] = min(arc[0], _MAX_START)
    start[size + DX : size + TILT + 1] = uniform[residuals.DX : residuals.TILT + 1]
    return start
