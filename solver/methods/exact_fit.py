"""Least squares with the exact beam: contact and force where the deformation plane is known.

All visible points at once, each with its own sigma, together with the moment sensor where there
is one; the clamp's pose is a nuisance with the prior that the rest image and the rig's
tolerances give it. Attains the information limit for white noise, and keeps 95 % of it with up to
40 % of outliers. The plane is C itself (psi = 0), or that in which a flat strip bends
(`rig.known_psi`, eqs. (7) and (8)). It needs neither the contact nor the tip to be visible.
"""

from solver.fitting.fit_estimate import LEAST_POINTS, estimate_from_fit, refusal_of
from solver.fitting.problem import fit_from, problem_of, start_of
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement


def exact_fit(measurement: Measurement) -> Estimate:
    """Contact, force and displacement in the known plane, with their joint covariance."""
    # In a known plane the tip tells little beside the points, and may be an occluder's edge.
    problem = problem_of(measurement, with_tips=False)
    known_psi = measurement.rig.known_psi
    # Seen in a mirror, where the rig deflects to -y, a plane leans the other way.
    psi = measurement.handedness * (known_psi or 0.0)
    start = start_of(problem, psi) if problem.points >= LEAST_POINTS else None
    fit = None if start is None else fit_from(problem, start, psi_free=False)
    refusal = refusal_of(measurement, problem, fit)
    if refusal is not None or fit is None:
        return refusal or Estimate(Outcome.NOT_CONVERGED)
    return estimate_from_fit(measurement, problem, fit, psi_known=known_psi is not None)
