"""From the exact beam's shape to what is asked of it: contact, force, displacement, covariance."""

from typing import Final

import numpy as np

from solver.beam_models import frictional
from solver.beam_models.exact import contact_at
from solver.fitting import frames
from solver.fitting.problem import FrameFit
from solver.fitting.residuals import DX, DY, LEVER, PSI, RIGIDITY, TILT, Q
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement

# By what the quantities have gradients. `rigidity` and `scale` are the relative errors of EI and of
# all lengths, `grip` is that of friction on the beam.
SHAPE: Final = ("q", "lever", "psi", "dx", "dy", "tilt", "motor_angle", "rigidity", "scale", "grip")
_ANGLE, _EI, _SCALE, _GRIP = (
    SHAPE.index(name) for name in ("motor_angle", "rigidity", "scale", "grip")
)
_LENGTHS: Final = [frames.X_C, frames.Y_C, frames.S_C]
_TOUCHED: Final = [frames.FORCE, frames.THETA, *_LENGTHS, frames.LEAN]


def shape_quantities(
    measurement: Measurement,
    shape: Floats,
    *,
    psi_fitted: bool = False,
    clamp_fitted: bool = False,
    grip_fitted: bool = False,
) -> tuple[dict[str, float], Floats, Floats]:
    """Values (m,) of an exact beam, their Jacobian (m, 10) by `SHAPE`, what Sigma_a adds (m, m).

    `shape` (10,) is in the order of `SHAPE`, its error of lengths zero; a motor angle that is not
    known is of no account, nor is the grip unless it was fitted: a contact without friction has
    none. The other arguments and the last matrix are those of `in_all_frames`.
    """
    q, lever, error = float(shape[0]), float(shape[1]), float(shape[_EI])
    beam = measurement.rig.beam
    stiff = beam.flexural_rigidity * (1 + error)
    # Rows as `_TOUCHED`, the load F / EI first: value and gradient by (q, lever, grip).
    touched = np.zeros((len(_TOUCHED), 4))
    if grip_fitted:
        at = frictional.contact(q, lever, float(shape[_GRIP]), beam.radius)
        touched[:, 0] = at.load, at.theta_c, at.x_c, at.y_c, at.s_c, at.lean
        touched[:, 1:] = (
            at.d_load, at.d_theta_c, at.d_x_c, at.d_y_c, at.d_s_c, at.d_lean,
        )  # fmt: skip
    else:
        touched[0, :2] = q, 1.0
        touched[1:5, :3] = contact_at(q, lever)
    touched[0] *= stiff
    contact = np.zeros(frames.CONTACT)
    contact[_TOUCHED], contact[frames.PSI : frames.LEAN] = touched[:, 0], shape[2:_EI]
    by_shape = np.zeros((frames.CONTACT, len(SHAPE)))
    by_shape[np.ix_(_TOUCHED, [0, 1, _GRIP])] = touched[:, 1:]
    # By similarity: lengths grow with the scale, the force falls with its square.
    by_shape[_LENGTHS, _SCALE] = contact[_LENGTHS]
    force = contact[frames.FORCE]
    by_shape[frames.FORCE, [_EI, _SCALE]] = force / (1 + error), -2 * force
    by_shape[frames.PSI : frames.LEAN, 2:_EI] = np.eye(5)
    values, jacobian, placed = frames.in_all_frames(
        measurement, contact, psi_fitted=psi_fitted, clamp_fitted=clamp_fitted
    )
    return values, jacobian @ by_shape, placed


def values_of(
    measurement: Measurement, fit: FrameFit, psi_fitted: bool
) -> tuple[dict[str, float], Floats]:
    """The values that `fit` tells, by name, and their joint covariance.

    It holds the fit's own covariance, the rig's tolerances, the error of all lengths and the
    encoder's. `psi_fitted`: the fit has told psi.
    """
    rig, length = measurement.rig, measurement.rig.beam.length
    unit = np.array([length**-2, length, 1.0, length, length, 1.0, 1.0])
    chosen, rows = [Q, LEVER, PSI, DX, DY, TILT, RIGIDITY], [0, 1, 2, 3, 4, 5, _EI]
    shape = np.zeros(len(SHAPE))
    shape[rows] = fit.p[chosen] * unit
    covariance = np.zeros((len(SHAPE), len(SHAPE)))
    covariance[np.ix_(rows, rows)] = fit.covariance[np.ix_(chosen, chosen)] * np.outer(unit, unit)
    if covariance[_EI, _EI] == 0:  # where the fit had no need of EI
        tolerance = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
        covariance[_EI, _EI] = tolerance**2
    covariance[_SCALE, _SCALE] = measurement.scale_sigma**2
    if measurement.motor_angle is not None:
        shape[_ANGLE] = measurement.motor_angle
        covariance[_ANGLE, _ANGLE] = rig.tolerances.encoder**2
    values, jacobian, placed = shape_quantities(
        measurement, shape, psi_fitted=psi_fitted, clamp_fitted=True
    )
    return values, np.asarray(jacobian @ covariance @ jacobian.T + placed)
