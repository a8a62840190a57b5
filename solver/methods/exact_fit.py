"""Least squares with the exact beam: contact and force of a planar push (psi = 0).

All visible points at once, each with its own sigma; the clamp's pose is a nuisance with the
prior that the rest image and the rig's tolerances give it. Attains the information limit for
white noise. Use it whenever the deformation plane is the calibration plane; it needs neither
the contact nor the tip to be visible.
"""

import math

import numpy as np

from solver.beam_models import exact
from solver.fitting.correlation import correlation_length
from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.fitting.gauss_newton import Fit, Linearised, gauss_newton
from solver.fitting.terms import points_on_exact_beam, prior
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

# A place known worse than this share of the beam's length is only an interval.
WEAK_SIGMA = 1 / 7
LEAST_POINTS = 8


def exact_fit(measurement: Measurement) -> Estimate:
    """Contact distance, contact arc length, force and contact angle, with their covariance."""
    points = measurement.points
    if len(points) < LEAST_POINTS:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE, f"{len(points)} visible points, needed are {LEAST_POINTS}"
        )
    bend = nearest_linear_bend(measurement)
    refusal = no_contact(bend)
    if refusal is not None:
        return refusal
    # A start inside the model's domain, however steep the linear shape is.
    lever = bend.x_c
    q = min(6 * bend.amplitude, 1.6 / max(lever - points[:, 0].min(), lever) ** 2)
    start = np.array([q, lever, 0.0, 0.0, 0.0])

    def residuals(p: Floats) -> Linearised | None:
        on_beam = points_on_exact_beam(measurement, p[:2], p[2:])
        if on_beam is None:
            return None
        known, known_jacobian = prior(p[2:], measurement.base_covariance)
        padded = np.hstack([np.zeros((3, 2)), known_jacobian])
        return np.concatenate([on_beam[0], known]), np.vstack([on_beam[1], padded])

    fit = gauss_newton(residuals, start)
    dof = len(points) - 2
    if fit.rank_deficient:
        return Estimate(Outcome.NOT_IDENTIFIABLE, iterations=fit.iterations)
    if not fit.converged:
        return Estimate(Outcome.NOT_CONVERGED, iterations=fit.iterations)
    on_beam = points_on_exact_beam(measurement, fit.parameters[:2], fit.parameters[2:])
    assert on_beam is not None
    # Residuals larger than the stated sigmas widen the answer, smaller ones do not narrow it.
    widening = max(fit.chi2 / dof, 1.0) * correlation_length(on_beam[0])
    return _answer(fit, dof, measurement, widening)


def _answer(fit: Fit, dof: int, measurement: Measurement, widening: float) -> Estimate:
    q, lever = (float(v) for v in fit.parameters[:2])
    beam_length, rigidity = measurement.rig.beam.length, measurement.rig.beam.flexural_rigidity
    tolerances = measurement.rig.tolerances
    at = exact.contact(q, lever)
    values = {
        "x_c_m": at.x_c,
        "y_c_m": at.y_c,
        "s_c_m": at.s_c,
        "force_n": q * rigidity,
        "theta_c_rad": at.theta_c,
    }
    jacobian = np.vstack([at.d_x_c, at.d_y_c, at.d_s_c, [rigidity, 0.0], at.d_theta_c])
    covariance = jacobian @ (fit.covariance[:2, :2] * widening) @ jacobian.T
    # What the rig itself does not know. By similarity a relative error e of all lengths changes
    # lengths by e, force by -2 e and no angle; the force is proportional to EI.
    by_scale = np.array([at.x_c, at.y_c, at.s_c, -2 * q * rigidity, 0.0])
    covariance += np.outer(by_scale, by_scale) * measurement.scale_sigma**2
    covariance[3, 3] += (q * tolerances.flexural_rigidity) ** 2

    s_sigma = math.hypot(math.sqrt(covariance[2, 2]), tolerances.beam_length)
    if at.s_c > beam_length + 3 * s_sigma:
        return Estimate(
            Outcome.INVALID,
            f"the shape would be touched at {at.s_c:.4g} m, beyond the tip at {beam_length:.4g} m",
            chi2=fit.chi2,
            dof=dof,
            iterations=fit.iterations,
        )
    x_sigma = math.sqrt(covariance[0, 0])
    if x_sigma > beam_length:
        return Estimate(Outcome.NOT_IDENTIFIABLE, iterations=fit.iterations)
    if at.x_c / 4 < x_sigma <= WEAK_SIGMA * beam_length:
        # Of a short stretch the noise alone makes such shapes, and no sigma says so.
        return Estimate(
            Outcome.NOT_IDENTIFIABLE,
            "the contact would lie within four sigma of the clamp",
            iterations=fit.iterations,
        )
    outcome = Outcome.CONTACT
    if x_sigma > WEAK_SIGMA * beam_length:
        outcome = Outcome.WEAK_CONTACT
    elif at.s_c > beam_length - 2 * s_sigma:
        outcome = Outcome.TIP_CONTACT
    return Estimate(
        outcome,
        values=values,
        covariance=covariance,
        chi2=fit.chi2,
        dof=dof,
        iterations=fit.iterations,
    )
