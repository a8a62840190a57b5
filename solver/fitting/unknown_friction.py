"""Add the uncertainty due to a friction that the rig does not state to a single frame's estimate.

A single image hardly distinguishes a force inclined against the beam's normal from a normal force
at another place. The values are those without friction; their covariance contains what a friction
ratio of zero mean changes to first order (a considered parameter; Schmidt 1966), and of the force's
magnitude to second order.
"""

from dataclasses import replace

import numpy as np

from solver.beams.beam import FRICTION_RATIO
from solver.core.least_squares import CONVERGED
from solver.core.robust import VARIANCE_FACTOR
from solver.fitting.frame_estimate import fit_frame, with_bow
from solver.fitting.frame_problem import frame_problem_of, only
from solver.fitting.frame_values import frame_values
from solver.fitting.robust_fit import residuals_at
from solver.fitting.verdict import classified_estimate
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.uniform.problem import problem_of


def with_unknown_friction(alone: Estimate, measurement: Measurement, sigma: float) -> Estimate:
    """Add a friction ratio of this `sigma` to the estimate `alone`, in which it is zero."""
    if alone.covariance is None:
        return alone
    bowed = with_bow(measurement)
    problem = problem_of(bowed, with_tip=False)
    fitted = fit_frame(problem, frame_problem_of(bowed, problem))
    if fitted is None or fitted.fit.status != CONVERGED:
        return alone
    model, fit = fitted.model, fitted.fit
    rows = residuals_at(only(model, fit.kept), fit.p)
    assert rows is not None, "the fit has a shape"
    gradient = rows.jacobian @ rows.jacobian[FRICTION_RATIO]
    # The fit's gain: its covariance without what outliers and correlated errors have added.
    widened = fit.variance_inflation * (1.0 if fit.kept.all() else VARIANCE_FACTOR)
    response = -fit.covariance @ gradient / widened
    response[FRICTION_RATIO] = 1.0
    considered = fit.covariance + sigma**2 * np.outer(response, response)
    _, without = frame_values(measurement, model, fit)
    _, covariance = frame_values(measurement, model, replace(fit, covariance=considered))
    return classified_estimate(
        measurement.rig,
        alone.values,
        alone.covariance + covariance - without,
        alone.message,
        chi2=alone.chi2,
        dof=alone.dof,
        iterations=alone.iterations,
    )
