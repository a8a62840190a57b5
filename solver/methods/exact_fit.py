"""Least squares with the exact beam: contact and force where the deformation plane is known.

The fit uses all visible points at once, each with its own sigma, and of a uniform strip the moment
sensor if there is one. The clamp's pose is a nuisance parameter with the prior of the rest image
and the rig's tolerances. The fit attains the information limit for white noise, and 95 % of it with
up to 40 % of outliers. The plane is C itself (psi = 0), or that in which a flat strip bends
(`rig.known_psi`, eqs. (7) and (8)). Neither the contact nor the tip needs to be visible.

Where the rig states that the beam may be tapered or out of round, or that objects have friction,
where its shape was learned, or where it has a bow that matters, the fit is that of
`frame_estimate`, which also judges a uniform beam whose residuals are no white noise.
"""

from functools import partial

from solver.fitting.frame_estimate import frame_estimate
from solver.fitting.frame_problem import OwnBeamOf, frame_problem_of
from solver.fitting.neighbours import is_shaded
from solver.fitting.uniform_estimate import uniform_estimate
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement


def exact_fit(measurement: Measurement, *, beam: OwnBeamOf | None = None) -> Estimate:
    """Estimate contact, force and displacement in the known plane, with their joint covariance.

    `beam` makes a beam of the user's own, as in `solver.beams.own_beam`, of the one that the rig
    states.
    """
    if beam is not None or not measurement.uniform:
        return frame_estimate(measurement, partial(frame_problem_of, own_beam=beam)).estimate
    estimate, white = uniform_estimate(measurement)
    if not estimate.values or (white and not is_shaded(measurement.view.lost_light)):
        return estimate
    # A beam of another shape is refused. Otherwise all points scatter by more than is stated, or
    # neighbouring ones share errors: unless an object's shade explains them, the estimate with the
    # larger sigma answers for both.
    judged, shaded = frame_estimate(measurement)
    if judged.outcome is Outcome.INVALID or shaded:
        return judged
    sigma = judged.sigma("x_c_m") if judged.values else 0.0
    return judged if sigma > estimate.sigma("x_c_m") else estimate
