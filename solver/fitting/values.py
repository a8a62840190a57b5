"""Convert the exact beam's shape to contact, force and displacement, with covariance."""

from typing import Final

import numpy as np

from solver.beams import frictional
from solver.beams.exact import contact_at
from solver.fitting import frames
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit
from solver.uniform.residuals import PARAMETERS

# Variables of the gradients. `rigidity` and `scale` are the relative errors of EI and of all
# lengths, `friction_ratio` is the friction ratio (see `frictional`).
SHAPE: Final = (
    "q",
    "lever",
    "psi",
    "dx",
    "dy",
    "tilt",
    "motor_angle",
    "rigidity",
    "scale",
    "friction_ratio",
)
_ANGLE, _EI, _SCALE, _FRICTION_RATIO = (
    SHAPE.index(name) for name in ("motor_angle", "rigidity", "scale", "friction_ratio")
)
_LENGTHS: Final = (frames.X_C, frames.Y_C, frames.S_C)
_CONTACT_ROWS: Final = (frames.FORCE, frames.THETA, *_LENGTHS, frames.LEAN)


def shape_quantities(
    measurement: Measurement,
    shape: Floats,
    *,
    psi_fitted: bool = False,
    clamp_fitted: bool = False,
    friction_fitted: bool = False,
) -> tuple[dict[str, float], Floats, Floats]:
    """Compute an exact beam's values (m,), Jacobian (m, 10) by `SHAPE`, covariance by Sigma_a.

    `shape` (10,) is in the order of `SHAPE`, with a zero error of lengths. An unknown motor angle
    has no effect, nor has the friction ratio unless it was fitted: a contact without friction has
    none. The other arguments and the last matrix (m, m) are those of `in_all_frames`.
    """
    q, lever, beam = float(shape[0]), float(shape[1]), measurement.rig.beam
    if friction_fitted:
        state = frictional.contact(q, lever, float(shape[_FRICTION_RATIO]), beam.radius)
        quantities = np.empty((len(_CONTACT_ROWS), 4))
        quantities[:, 0] = state.load, state.theta_c, state.x_c, state.y_c, state.s_c, state.lean
        quantities[:, 1:] = (
            state.d_load, state.d_theta_c, state.d_x_c, state.d_y_c, state.d_s_c, state.d_lean,
        )  # fmt: skip
    else:
        quantities = _frictionless(q, lever)
    contact, by_shape = _contact(quantities, shape, beam.flexural_rigidity)
    values, jacobian, pose_covariance = frames.in_all_frames(
        measurement, contact, psi_fitted=psi_fitted, clamp_fitted=clamp_fitted
    )
    return values, jacobian @ by_shape, pose_covariance


@njit
def _frictionless(q: float, lever: float) -> Floats:
    """Compute `_CONTACT_ROWS`, load F / EI first: value, gradient by (q, lever, friction ratio)."""
    quantities = np.zeros((len(_CONTACT_ROWS), 4))
    quantities[0, 0], quantities[0, 1] = q, 1.0
    for i, entry in enumerate(contact_at(q, lever)):
        quantities[1 + i, 0], quantities[1 + i, 1], quantities[1 + i, 2] = entry
    return quantities


@njit
def _contact(quantities: Floats, shape: Floats, flexural_rigidity: float) -> tuple[Floats, Floats]:
    """Compute the contact (11,) as defined in `frames` and its Jacobian (11, 10) by `SHAPE`."""
    contact = np.zeros(frames.CONTACT)
    by_shape = np.zeros((frames.CONTACT, len(SHAPE)))
    for i, row in enumerate(_CONTACT_ROWS):
        contact[row] = quantities[i, 0]
        for k, column in enumerate((0, 1, _FRICTION_RATIO)):
            by_shape[row, column] = quantities[i, 1 + k]
    rigidity = flexural_rigidity * (1 + shape[_EI])
    contact[frames.FORCE] *= rigidity
    for k in range(len(SHAPE)):
        by_shape[frames.FORCE, k] *= rigidity
    # By similarity: lengths grow with the scale, the force falls with its square.
    for row in _LENGTHS:
        by_shape[row, _SCALE] = contact[row]
    by_shape[frames.FORCE, _EI] = contact[frames.FORCE] / (1 + shape[_EI])
    by_shape[frames.FORCE, _SCALE] = -2 * contact[frames.FORCE]
    # Inclination, clamp and motor angle are copied.
    for k in range(frames.LEAN - frames.PSI):
        contact[frames.PSI + k] = shape[2 + k]
        by_shape[frames.PSI + k, 2 + k] = 1.0
    return contact, by_shape


def values_of(
    measurement: Measurement, fit: FrameFit, psi_fitted: bool
) -> tuple[dict[str, float], Floats]:
    """Compute the values of a fit, by name, and their joint covariance.

    The covariance contains the fit's own, the rig's tolerances, the error of all lengths and the
    encoder's. `psi_fitted` is True if the values of the third dimension are estimated.
    """
    rig, length = measurement.rig, measurement.rig.beam.length
    # The fit's parameters are in the order of `SHAPE`, except that the stretch has the index of
    # the motor angle.
    unit = np.array([length**-2, length, 1.0, length, length, 1.0, 0.0, 1.0])
    shape, covariance = np.zeros(len(SHAPE)), np.zeros((len(SHAPE), len(SHAPE)))
    shape[:PARAMETERS] = fit.p * unit
    covariance[:PARAMETERS, :PARAMETERS] = fit.covariance * (unit[:, None] * unit)
    if covariance[_EI, _EI] == 0:  # where the fit did not use EI
        tolerance = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
        covariance[_EI, _EI] = tolerance**2
    covariance[_SCALE, _SCALE] = measurement.scale_sigma**2
    if measurement.motor_angle is not None:
        shape[_ANGLE] = measurement.motor_angle
        covariance[_ANGLE, _ANGLE] = rig.tolerances.encoder**2
    values, jacobian, pose_covariance = shape_quantities(
        measurement, shape, psi_fitted=psi_fitted, clamp_fitted=True
    )
    return values, np.asarray(jacobian @ covariance @ jacobian.T + pose_covariance)
