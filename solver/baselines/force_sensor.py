"""Conventional antenna of section VII: force and moment at the clamp alone, no camera.

The clamp exerts on the beam the reverse of the contact force F (-sin theta_c, cos theta_c) in the
deformation plane, and of its moment F lever about the clamp; a contact without friction adds no
torsion. These six readings overdetermine three unknowns: F, its lever arm and the plane's
inclination psi. Weighted least squares with the sensor's sigmas gives the exact beam's shape,
whose sin theta_c = F lever^2 / (2 EI), and so the contact distance; the paper's moment over force
is the same for small deflections. Readings that no frictionless contact can give are rejected.

The sensor measures in the axes of the clamp, which are assumed to be those of the beam at rest.
"""

import math

import numpy as np
from scipy.special import chdtri

from solver.beams.exact import MOST_SINE
from solver.core.least_squares import Fit, Rows, fit_rows
from solver.core.thresholds import THRESHOLDS
from solver.fitting.uniform_estimate import SHAPE, shape_quantities
from solver.fitting.verdict import classified_estimate
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.uniform.starts import MAX_START


def force_sensor(measurement: Measurement) -> Estimate:
    """Estimate contact, force and inclination psi from the clamp's readings, with covariance."""
    sensors = measurement.rig.sensors
    if (
        measurement.base_force is None
        or measurement.base_moment is None
        or sensors.base_force is None
        or sensors.base_moment is None
    ):
        return Estimate(Outcome.INVALID, "the rig has no sensor of force and moment at its clamp")
    sigma = np.repeat([sensors.base_force, sensors.base_moment], 3)
    load = _load_on_beam(measurement)
    significance = float(((load / sigma) ** 2).sum())
    if significance < chdtri(6, THRESHOLDS.false_alarm):
        return Estimate(
            Outcome.NO_CONTACT, f"a load of {math.sqrt(significance):.1f} sigmas at the clamp"
        )
    rigidity, length = measurement.rig.beam.flexural_rigidity, measurement.rig.beam.length

    def residuals(p: Floats) -> Rows | None:
        predicted = _predicted(p, rigidity)
        if predicted is None:
            return None
        return Rows((predicted.residual - load) / sigma, predicted.jacobian / sigma)

    force, moment = (float(np.linalg.norm(part)) for part in (load[:3], load[3:]))
    # The moment is normal to the plane. Start inside the model's domain.
    lever = min(max(moment / max(force, sensors.base_force), length / 100), length)
    q = min(max(moment / lever / rigidity, 1e-9), MAX_START / lever**2)
    fit = fit_rows(residuals, np.array([q, lever, math.atan2(-load[4], load[5])]), step_sigmas=1e-2)
    return _estimate(measurement, fit)


def _load_on_beam(measurement: Measurement) -> Floats:
    """Compute the object's force [N], moment [N m] about the clamp (6,), in the beam's axes."""
    axes = measurement.antenna_from_beam[:3, :3]
    force = -axes.T @ np.asarray(measurement.base_force)
    # A moment is an axial vector: mirrored axes reverse it.
    moment = -measurement.handedness * axes.T @ np.asarray(measurement.base_moment)
    return np.concatenate([force, moment])


def _predicted(p: Floats, rigidity: float) -> Rows | None:
    """Compute force and moment on the beam (6,) and their Jacobian (3, 6) by (q, lever, psi)."""
    q, lever, psi = (float(v) for v in p)
    sine = q * lever**2 / 2
    if not (q > 0 and lever > 0 and sine < MOST_SINE):
        return None
    cosine = math.sqrt(1 - sine**2)
    sin_psi, cos_psi = math.sin(psi), math.cos(psi)
    along, across = np.array([1.0, 0.0, 0.0]), np.array([0.0, cos_psi, sin_psi])
    normal = np.array([0.0, -sin_psi, cos_psi])
    force = rigidity * q
    direction = -sine * along + cosine * across
    by_sine = force * (-along - sine / cosine * across)
    jacobian = np.empty((3, 6))
    jacobian[0, :3] = rigidity * direction + by_sine * lever**2 / 2
    jacobian[1, :3] = by_sine * q * lever
    jacobian[2, :3] = force * cosine * normal
    jacobian[0, 3:] = rigidity * lever * normal
    jacobian[1, 3:] = force * normal
    jacobian[2, 3:] = -force * lever * across
    return Rows(np.concatenate([force * direction, force * lever * normal]), jacobian)


def _estimate(measurement: Measurement, fit: Fit) -> Estimate:
    dof = 3

    def failure(
        outcome: Outcome, message: str = "", assumption: Assumption | None = None
    ) -> Estimate:
        return Estimate(
            outcome,
            message,
            chi2=fit.chi2,
            dof=dof,
            iterations=fit.iterations,
            assumption=assumption,
        )

    if fit.rank_deficient:
        return failure(Outcome.NOT_IDENTIFIABLE)
    if fit.chi2 > chdtri(dof, THRESHOLDS.false_rejection):
        return failure(
            Outcome.INVALID,
            f"force and moment do not fit one contact without friction: chi^2 is "
            f"{fit.chi2:.3g} on {dof} degrees of freedom",
        )
    if not fit.converged:
        return failure(Outcome.NOT_CONVERGED)
    q, lever, psi = (float(v) for v in fit.parameters)
    if abs(math.remainder(psi, math.tau)) > math.pi / 2 + 3 * math.sqrt(fit.covariance[2, 2]):
        return failure(
            Outcome.INVALID,
            "the beam is pushed from the side where the rig has no object",
            Assumption.SIDE,
        )
    rig = measurement.rig
    shape = np.zeros(len(SHAPE))
    column = {name: i for i, name in enumerate(SHAPE)}
    shape[:3] = q, lever, math.remainder(psi, math.tau)
    shape[column["motor_angle"]] = measurement.motor_angle or 0.0
    values, by_shape, placement = shape_quantities(measurement, shape, psi_fitted=True)
    # Force and lever are measured; with another flexural rigidity they give another shape.
    by_shape[:, column["rigidity"]] -= by_shape[:, 0] * q
    tolerances = np.zeros(len(SHAPE))
    tolerances[column["motor_angle"]] = rig.tolerances.encoder
    tolerances[column["rigidity"]] = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
    input_covariance = np.diag(tolerances**2)
    input_covariance[:3, :3] = fit.covariance
    input_covariance[3:6, 3:6] = measurement.base_covariance
    covariance = by_shape @ input_covariance @ by_shape.T + placement
    return classified_estimate(
        rig, values, covariance, "", chi2=fit.chi2, dof=dof, iterations=fit.iterations
    )
