"""Least squares with the exact beam: contact and force where the deformation plane is known.

The fit uses all visible points at once, each with its own sigma, and the moment sensor if there is
one. The clamp's pose is a nuisance parameter with the prior of the rest image and the rig's
tolerances. The fit attains the information limit for white noise, and 95 % of it with up to 40 % of
outliers. The plane is C itself (psi = 0), or that in which a flat strip bends (`rig.known_psi`,
eqs. (7) and (8)). Neither the contact nor the tip needs to be visible.

Where the rig states that the beam may be tapered or out of round, or that objects have friction, or
where its shape was learned, the fit is that of `rod_estimate`.
"""

from solver.fitting.fit import fit_from, start_of
from solver.fitting.fit_estimate import estimate_from_fit, refusal_of
from solver.fitting.problem import problem_of
from solver.fitting.rod_estimate import rod_estimate
from solver.fitting.thresholds import LIMITS
from solver.fitting.values import values_of
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement


def exact_fit(measurement: Measurement) -> Estimate:
    """Estimate contact, force and displacement in the known plane, with their joint covariance."""
    if not measurement.rig.shape.uniform:
        return rod_estimate(measurement)
    # In a known plane the tip adds little to the points, and may be an occluder's edge.
    problem = problem_of(measurement, with_tips=False)
    known_psi = measurement.rig.known_psi
    # If the rig deflects to -y, the beam's frame is mirrored and the inclination changes its sign.
    psi = measurement.handedness * (known_psi or 0.0)
    start = start_of(problem, psi) if problem.points >= LIMITS.min_points else None
    fit = None if start is None else fit_from(problem, start, psi_free=False)
    refusal = refusal_of(measurement, problem, fit)
    if refusal is not None or fit is None:
        return refusal or Estimate(Outcome.NOT_CONVERGED)
    values, covariance = values_of(measurement, fit, known_psi is not None)
    return estimate_from_fit(measurement, problem, fit, values, covariance)
