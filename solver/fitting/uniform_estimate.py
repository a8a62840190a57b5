"""Estimate from one frame of a straight uniform beam, in closed form."""

from typing import Final, NamedTuple

import numpy as np

from solver.beams.exact import contact_at
from solver.core.thresholds import THRESHOLDS
from solver.fitting import frames
from solver.fitting.verdict import estimate_from_fit, refusal_of
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.uniform.fit import FrameFit, fit_from, start_of
from solver.uniform.problem import problem_of
from solver.uniform.residuals import PARAMETERS

# Variables of the gradients. `rigidity` and `scale` are the relative errors of EI and of all
# lengths.
SHAPE: Final = ("q", "lever", "psi", "dx", "dy", "tilt", "motor_angle", "rigidity", "scale")
_ANGLE, _EI, _SCALE = (SHAPE.index(name) for name in ("motor_angle", "rigidity", "scale"))
_LENGTHS: Final = (frames.X_C, frames.Y_C, frames.S_C)
_CONTACT_ROWS: Final = (frames.THETA, *_LENGTHS)


class UniformEstimate(NamedTuple):
    """Estimate of a frame; `white` is whether its residuals look like independent errors."""

    estimate: Estimate
    white: bool = True


def uniform_estimate(measurement: Measurement) -> UniformEstimate:
    """Estimate contact and force in the known plane, whatever else rig.json states of the beam."""
    # In a known plane the tip adds little to the points, and may be an occluder's edge.
    problem = problem_of(measurement, with_tip=False)
    known_psi = measurement.rig.known_psi
    # If the rig deflects to -y, the beam's frame is mirrored and the inclination changes its sign.
    psi = measurement.handedness * (known_psi or 0.0)
    start = start_of(problem, psi) if problem.points >= THRESHOLDS.min_points else None
    fit = None if start is None else fit_from(problem, start, psi_free=False)
    refusal = refusal_of(measurement, problem, fit)
    if refusal is not None or fit is None:
        return UniformEstimate(refusal or Estimate(Outcome.NOT_CONVERGED))
    values, covariance = uniform_values(measurement, fit, known_psi is not None)
    estimate = estimate_from_fit(measurement, problem, fit, values, covariance)
    return UniformEstimate(estimate, fit.variance_inflation == 1)


def shape_quantities(
    measurement: Measurement, shape: Floats, *, psi_fitted: bool = False, clamp_fitted: bool = False
) -> tuple[dict[str, float], Floats, Floats]:
    """Compute a uniform beam's values (m,), Jacobian (m, 9) by `SHAPE`, covariance by Sigma_a.

    `shape` (9,) is in the order of `SHAPE`, with a zero error of lengths. An unknown motor angle
    has no effect. The other arguments and the last matrix (m, m) are those of `in_all_frames`.
    """
    contact, by_shape = _contact(shape, measurement.rig.beam.flexural_rigidity)
    values, jacobian, pose_covariance = frames.in_all_frames(
        measurement, contact, psi_fitted=psi_fitted, clamp_fitted=clamp_fitted
    )
    return values, jacobian @ by_shape, pose_covariance


@njit
def _contact(shape: Floats, flexural_rigidity: float) -> tuple[Floats, Floats]:
    """Compute the contact (11,) as defined in `frames` and its Jacobian (11, 9) by `SHAPE`."""
    contact = np.zeros(frames.CONTACT)
    by_shape = np.zeros((frames.CONTACT, len(SHAPE)))
    for i, entry in enumerate(contact_at(shape[0], shape[1])):
        row = _CONTACT_ROWS[i]
        contact[row], by_shape[row, 0], by_shape[row, 1] = entry
    rigidity = flexural_rigidity * (1 + shape[_EI])
    contact[frames.FORCE], by_shape[frames.FORCE, 0] = rigidity * shape[0], rigidity
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


def uniform_values(
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
