"""Convert a fit of two contacts to values of both, with their joint covariance."""

import math
from typing import Final

import numpy as np

from solver.beam_models.two_contacts import PARAMETERS, contacts_of, two_contacts_of
from solver.fitting import frames
from solver.fitting.fit import FrameFit
from solver.fitting.rod_residuals import DX, DY, PSI, TILT
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement

# Names of the outer contact's values, by those of a single contact.
_SECOND: Final = {
    name: f"second_{name}"
    for name in (
        "s_c_m",
        "force_n",
        *(f"contact_antenna_{axis}_m" for axis in "xyz"),
        *(f"force_{axis}_n" for axis in "xyz"),
    )
}
# Variables after the fit's parameters: relative errors of all lengths and of EI, the motor angle.
_SCALE, _RIGIDITY, _ANGLE = range(3)
_VARIABLES: Final = 3


def two_contact_values(measurement: Measurement, fit: FrameFit) -> tuple[dict[str, float], Floats]:
    """Compute the values of a fit by name, and their joint covariance.

    The inner contact has the names of a single one, the outer one those of `second_...`.
    """
    rig, shape, count = measurement.rig, fit.p[:PARAMETERS], len(fit.p)
    values: dict[str, float] = {}
    by_variables, by_poses = [], []
    quantities, by_shape = contacts_of(two_contacts_of(shape), shape)
    for i, names in enumerate(({name: name for name in frames.NAMES}, _SECOND)):
        contact, by_variable = _contact(measurement, fit.p, quantities[i], by_shape[i])
        estimated, by_contact, by_pose = frames.with_jacobians(
            measurement, contact, clamp_fitted=True
        )
        # A force has a magnitude; its sign is that of the components.
        sign = math.copysign(1.0, estimated["force_n"])
        estimated["force_n"] *= sign
        labels = list(estimated)
        by_contact[labels.index("force_n")] *= sign
        kept = [k for k, label in enumerate(labels) if label in names]
        values |= {names[labels[k]]: estimated[labels[k]] for k in kept}
        by_variables.append((by_contact @ by_variable)[kept])
        by_poses.append(by_pose[kept])
    covariance = np.zeros((count + _VARIABLES, count + _VARIABLES))
    covariance[:count, :count] = fit.covariance
    tolerances = rig.tolerances
    sigmas = (
        measurement.scale_sigma,
        tolerances.flexural_rigidity / rig.beam.flexural_rigidity,
        0.0 if measurement.motor_angle is None else tolerances.encoder,
    )
    covariance[range(count, count + _VARIABLES), range(count, count + _VARIABLES)] = np.square(
        sigmas
    )
    total = np.concatenate(by_variables)
    pose_covariance = frames.pose_covariance(measurement, np.concatenate(by_poses))
    return values, np.asarray(total @ covariance @ total.T + pose_covariance)


def _contact(
    measurement: Measurement, p: Floats, quantities: Floats, by_shape: Floats
) -> tuple[Floats, Floats]:
    """Compute a contact (11,) as defined in `frames`, and its Jacobian by parameters, variables."""
    beam, count = measurement.rig.beam, len(p)
    length, force_unit = beam.length, beam.flexural_rigidity / beam.length**2
    contact = np.zeros(frames.CONTACT)
    jacobian = np.zeros((frames.CONTACT, count + _VARIABLES))
    rows = [frames.FORCE, frames.THETA, frames.X_C, frames.Y_C, frames.S_C]
    units = np.array([force_unit, 1.0, length, length, length])
    contact[rows] = quantities * units
    jacobian[rows, :PARAMETERS] = by_shape * units[:, None]
    # By similarity: lengths grow with the scale, forces fall with its square.
    for row in (frames.X_C, frames.Y_C, frames.S_C):
        jacobian[row, count + _SCALE] = contact[row]
    jacobian[frames.FORCE, count + _SCALE] = -2 * contact[frames.FORCE]
    jacobian[frames.FORCE, count + _RIGIDITY] = contact[frames.FORCE]
    for row, column, unit in (
        (frames.PSI, PSI, 1.0),
        (frames.DX, DX, length),
        (frames.DY, DY, length),
        (frames.TILT, TILT, 1.0),
    ):
        contact[row] = p[PARAMETERS + column] * unit
        jacobian[row, PARAMETERS + column] = unit
    contact[frames.ANGLE] = measurement.motor_angle or 0.0
    jacobian[frames.ANGLE, count + _ANGLE] = 1.0
    return contact, jacobian
