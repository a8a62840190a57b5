"""Estimate from one frame of a straight uniform beam, in closed form."""

from typing import NamedTuple

from solver.core.thresholds import THRESHOLDS
from solver.fitting.fit_estimate import estimate_from_fit, refusal_of
from solver.fitting.uniform_values import uniform_values
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.uniform.fit import fit_from, start_of
from solver.uniform.problem import problem_of


class UniformEstimate(NamedTuple):
    """Estimate of a frame; `white` is whether its residuals look like independent errors."""

    estimate: Estimate
    white: bool = True


def uniform_estimate(measurement: Measurement) -> UniformEstimate:
    """Estimate contact and force in the known plane, whatever else rig.json states of the beam."""
    # In a known plane the tip adds little to the points, and may be an occluder's edge.
    problem = problem_of(measurement, with_tip=False)
    known_psi = measurement.rig.known_psi
    # If the rig deflects to -y, the beam's frame is mirrored and the inclination changes its sign.
    psi = measurement.handedness * (known_psi or 0.0)
    start = start_of(problem, psi) if problem.points >= THRESHOLDS.min_points else None
    fit = None if start is None else fit_from(problem, start, psi_free=False)
    refusal = refusal_of(measurement, problem, fit)
    if refusal is not None or fit is None:
        return UniformEstimate(refusal or Estimate(Outcome.NOT_CONVERGED))
    values, covariance = uniform_values(measurement, fit, known_psi is not None)
    estimate = estimate_from_fit(measurement, problem, fit, values, covariance)
    return UniformEstimate(estimate, fit.variance_inflation == 1)
