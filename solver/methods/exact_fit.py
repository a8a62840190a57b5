"""Least squares with the exact beam: contact and force of a planar push (psi = 0).

All visible points at once, each with its own sigma; the clamp's pose is a nuisance with the
prior that the rest image and the rig's tolerances give it. Attains the information limit for
white noise. Use it whenever the deformation plane is the calibration plane; it needs neither
the contact nor the tip to be visible.
"""

import math

import numpy as np

from solver.beam_models import exact, linear
from solver.fitting.correlation import correlation_length
from solver.fitting.gauss_newton import Fit, Linearised, gauss_newton
from solver.fitting.terms import points_on_exact_beam, prior
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

# Signal-to-noise ratio y_end sqrt(N) / sigma under which there is no contact, and under which
# its place is only an interval (sigma of x_c above about a seventh of the length).
NO_CONTACT_SNR = 5.0
WEAK_CONTACT_SNR = 60.0
LEAST_POINTS = 8


def exact_fit(measurement: Measurement) -> Estimate:
    """Contact distance, contact arc length, force and contact angle, with their covariance."""
    points = measurement.points
    if len(points) < LEAST_POINTS:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE, f"{len(points)} visible points, needed are {LEAST_POINTS}"
        )
    snr = signal_to_noise(measurement)
    if abs(snr) < NO_CONTACT_SNR:
        return Estimate(Outcome.NO_CONTACT, f"deflection is {abs(snr):.1f} sigmas")
    if snr < 0:
        return Estimate(Outcome.INVALID, "the beam bends to the side where the rig has no object")
    start = _linear_start(measurement)
    if start is None:
        return Estimate(Outcome.INVALID, "no shape of a beam pushed at one point comes near")

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
    return _answer(fit, dof, snr, measurement, widening)


def signal_to_noise(measurement: Measurement) -> float:
    """Deflection at the far end of the visible beam over the sigma of its mean, signed."""
    order = np.argsort(measurement.points[:, 0])
    end = order[-max(len(order) // 20, 1) :]
    sigma = float(np.median(np.linalg.norm(measurement.sigma_vectors, axis=1)))
    return float(np.median(measurement.points[end, 1])) * math.sqrt(len(order)) / sigma


def _linear_start(measurement: Measurement) -> Floats | None:
    """(q, lever, 0, 0, 0) of the best linear beam over a grid of contact distances."""
    x, y = measurement.points.T
    distances = measurement.rig.beam.length * np.linspace(0.02, 1.0, 50)
    shapes = linear.unit_deflection(x[:, None], distances)
    amplitude = (shapes * y[:, None]).sum(axis=0) / (shapes**2).sum(axis=0)
    misfit = ((y[:, None] - amplitude * shapes) ** 2).sum(axis=0)
    misfit[amplitude <= 0] = np.inf
    best = int(np.argmin(misfit))
    if not np.isfinite(misfit[best]):
        return None
    lever = float(distances[best])
    # A start inside the model's domain, however steep the linear shape is.
    q = min(6 * float(amplitude[best]), 1.6 / max(lever - x.min(), lever) ** 2)
    return np.array([q, lever, 0.0, 0.0, 0.0])


def _answer(fit: Fit, dof: int, snr: float, measurement: Measurement, widening: float) -> Estimate:
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
    if math.sqrt(covariance[0, 0]) > beam_length:
        return Estimate(Outcome.NOT_IDENTIFIABLE, iterations=fit.iterations)
    outcome = Outcome.CONTACT
    if snr < WEAK_CONTACT_SNR:
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
