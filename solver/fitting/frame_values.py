"""Convert the shape of a beam of changing section to contact, force and displacement."""

import math

import numpy as np

from solver.beams.beam import FRICTION_RATIO, BentBeam
from solver.core.parameters import Parameters
from solver.fitting import frames
from solver.fitting.frame_problem import FrameProblem
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig
from solver.uniform.fit import FrameFit


def frame_values(
    measurement: Measurement, model: FrameProblem, fit: FrameFit, psi_fitted: bool = False
) -> tuple[dict[str, float], Floats]:
    """Compute the values of a fit by name, and their joint covariance, as `uniform_values`."""
    count = len(fit.p)
    contact, jacobian = fitted_contact(
        measurement.rig, model, fit.p, measurement.motor_angle or 0.0
    )
    covariance = np.zeros((count + 3, count + 3))
    covariance[:count, :count] = fit.covariance
    covariance[range(count, count + 3), range(count, count + 3)] = input_variances(measurement)
    values, by_contact, pose_covariance = frames.in_all_frames(
        measurement, contact, psi_fitted=psi_fitted, clamp_fitted=True
    )
    total = by_contact @ jacobian
    result = np.asarray(total @ covariance @ total.T + pose_covariance)
    force, friction_ratio = list(values).index("force_n"), float(fit.p[FRICTION_RATIO])
    friction_ratio_sigma = math.sqrt(fit.covariance[FRICTION_RATIO, FRICTION_RATIO])
    result[force, force] += force_variance_second_order(
        values["force_n"], friction_ratio, friction_ratio_sigma
    )
    return values, result


def force_variance_second_order(force: float, friction_ratio: float, sigma: float) -> float:
    """Compute the second-order variance [N^2] of the force's magnitude due to friction.

    The magnitude is the component across the beam times sqrt(1 + friction ratio^2), whose slope is
    zero at zero friction ratio. The result is the mean square of the second-order term, for a
    normally distributed friction ratio with this `sigma`.
    """
    return 3 * (force * sigma**2 / (1 + friction_ratio**2) ** 2 / 2) ** 2


def input_variances(measurement: Measurement) -> Floats:
    """Compute variances (3,) of the motor angle, and relative ones of EI and of all lengths."""
    rig = measurement.rig
    tolerance = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
    scale = measurement.scale_sigma**2
    if measurement.rest_bow is not None:  # which this beam has in its shape
        scale -= measurement.rest_bow.scale_sigma**2
    encoder = 0.0 if measurement.motor_angle is None else rig.tolerances.encoder
    return np.array([encoder**2, math.hypot(tolerance, rig.shape.rigidity_sigma) ** 2, scale])


def fitted_contact(
    rig: Rig, model: FrameProblem, p: Floats, motor_angle: float
) -> tuple[Floats, Floats]:
    """Compute the contact (11,) as defined in `frames` and its Jacobian (11, p + 3).

    The Jacobian is by the parameters p (p,), the motor angle, and the relative errors of EI and of
    all lengths.
    """
    bent = model.bent(p)
    assert bent is not None, "the fit has a shape"
    return mounted_contact(rig, model.parameters, p, motor_angle, bent, 0)


def mounted_contact(
    rig: Rig, at: Parameters, p: Floats, motor_angle: float, bent: BentBeam, i: int
) -> tuple[Floats, Floats]:
    """Compute the contact `i` of a shape and its Jacobian, as `fitted_contact`; `at` names p."""
    values, by_shape = bent.contacts[i], bent.by_contacts[i]
    turning, by_moment = bent.moment, bent.by_moment
    size, count, length = len(by_moment), len(p), rig.beam.length
    angle, rigidity, scale = count, count + 1, count + 2
    contact, jacobian = np.zeros(frames.CONTACT), np.zeros((frames.CONTACT, count + 3))
    force_unit = rig.beam.flexural_rigidity / length**2
    rows = (frames.FORCE, frames.THETA, frames.X_C, frames.Y_C, frames.S_C, frames.LEAN)
    units = np.array([force_unit, 1.0, length, length, length, 1.0])
    contact[list(rows)] = values * units
    jacobian[list(rows), :size] = by_shape * units[:, None]
    for row in (frames.X_C, frames.Y_C, frames.S_C):
        jacobian[row, scale] = contact[row]
    jacobian[frames.FORCE, scale] = -2 * contact[frames.FORCE]
    jacobian[frames.FORCE, rigidity] = contact[frames.FORCE]
    for row, column, unit in (
        (frames.PSI, at["psi"], 1.0),
        (frames.DX, at["dx"], length),
        (frames.DY, at["dy"], length),
        (frames.TILT, at["tilt"], 1.0),
    ):
        contact[row], jacobian[row, column] = p[column] * unit, unit
    # A compliant clamp turns the beam in its mount, in which the contact is stated.
    softness = at["softness"]
    turn, by_turn = p[softness] * turning, np.zeros(count + 3)
    by_turn[:size] = p[softness] * by_moment
    by_turn[softness] = turning
    plane = [frames.X_C, frames.Y_C]
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    contact[plane] = rotation @ contact[plane]
    jacobian[plane] = rotation @ jacobian[plane]
    jacobian[frames.X_C] -= contact[frames.Y_C] * by_turn
    jacobian[frames.Y_C] += contact[frames.X_C] * by_turn
    contact[frames.THETA] += turn
    jacobian[frames.THETA] += by_turn
    contact[frames.ANGLE], jacobian[frames.ANGLE, angle] = motor_angle, 1.0
    return contact, jacobian
