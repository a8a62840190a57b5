"""Convert contact distance and load of linear theory to an estimate.

The force acts across the undeformed beam in the deformation plane, f = 6 EI load; its component
along the beam is neglected as in (11), so that f is the whole force. The displacement at
the contact is y_c = 2 load x_c^3, eqs. (28) and (29).
"""

from dataclasses import dataclass

import numpy as np

from solver.fitting import frames
from solver.fitting.first_contact import Bend, nearest_linear_bend, no_contact
from solver.fitting.verdict import classified_estimate
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.planes.plane_d import known_plane

# Order of the errors in `LinearContact.covariance`: contact distance [m], load [1/m^2], psi, the
# clamp's dx, dy [m] and tilt, relative error of all lengths, relative error of EI.
X_C, LOAD, PSI, BASE, SCALE, RIGIDITY = 0, 1, 2, slice(3, 6), 6, 7
ERRORS = 8


@dataclass(frozen=True)
class LinearContact:
    """Contact on D: x_c [m], load = f / (6 EI) [1/m^2], clamp (dx, dy, tilt) where it was fitted.

    `psi` [rad] is None where the method does not estimate it. `covariance` (8, 8) is that of the
    errors in the order given above.
    """

    x_c: float
    load: float
    covariance: Floats
    psi: float | None = None
    base: tuple[float, float, float] | None = None


def planar_bend(measurement: Measurement, least_points: int) -> tuple[Measurement, Bend] | Estimate:
    """Return the measurement on the known plane of the rig, and the beam's bend there.

    Returns an Estimate with the failure outcome if they are unknown or there is no contact.
    """
    count = len(measurement.points)
    if count < least_points:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE, f"{count} visible points, needed are {least_points}"
        )
    plane = known_plane(measurement)
    if isinstance(plane, Estimate):
        return plane
    planar, _ = plane
    bend = nearest_linear_bend(planar)
    return no_contact(bend) or (planar, bend)


def errors_of_planar_fit(measurement: Measurement, points_part: Floats, by_base: Floats) -> Floats:
    """Compute the covariance (8, 8) of an estimate that assumes the stated clamp, scale and EI.

    `points_part` (2, 2) is the covariance of (x_c, load) due to the points' noise, `by_base` (2, 3)
    their derivative by the clamp's true pose.
    """
    covariance = stated_errors(measurement)
    base = measurement.base_covariance
    covariance[:2, :2] = by_base @ base @ by_base.T + points_part
    # The clamp is assumed at rest: at a true (dx, dy, tilt), its error is -(dx, dy, tilt).
    covariance[:2, BASE] = -by_base @ base
    covariance[BASE, :2] = covariance[:2, BASE].T
    return covariance


def stated_errors(measurement: Measurement) -> Floats:
    """Compute the covariance (8, 8) stated by rig and measurement: clamp, scale, EI."""
    covariance = np.zeros((ERRORS, ERRORS))
    covariance[BASE, BASE] = measurement.base_covariance
    covariance[SCALE, SCALE] = measurement.scale_sigma**2
    rig = measurement.rig
    relative = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
    covariance[RIGIDITY, RIGIDITY] = relative**2
    return covariance


def estimate_from_linear_fit(
    contact: LinearContact,
    planar: Measurement,
    message: str = "",
    *,
    chi2: float | None = None,
    dof: int | None = None,
    iterations: int | None = None,
) -> Estimate:
    """Convert a contact on `planar`, the measurement un-projected onto D, to an estimate.

    Returns a failure outcome with its reason if the beam cannot have this contact.
    """
    rig, x_c, load = planar.rig, contact.x_c, contact.load
    force, y_c = 6 * rig.beam.flexural_rigidity * load, 2 * load * x_c**3
    entries = np.zeros(frames.CONTACT)
    entries[[frames.X_C, frames.Y_C, frames.FORCE]] = x_c, y_c, force
    entries[frames.DX : frames.TILT + 1] = contact.base or (0.0, 0.0, 0.0)
    entries[frames.ANGLE] = planar.motor_angle or 0.0
    by_error = np.zeros((frames.CONTACT, ERRORS + 1))
    by_error[frames.X_C, [X_C, SCALE]] = 1.0, x_c
    by_error[frames.Y_C, [X_C, LOAD, SCALE]] = 6 * load * x_c**2, 2 * x_c**3, y_c
    # By similarity: lengths grow with the scale, the force falls with its square.
    by_error[frames.FORCE, [LOAD, SCALE, RIGIDITY]] = force / load, -2 * force, force
    by_error[frames.PSI : frames.TILT + 1, PSI : BASE.stop] = np.eye(4)
    by_error[frames.ANGLE, ERRORS] = 1.0
    errors = np.zeros((ERRORS + 1, ERRORS + 1))
    errors[:ERRORS, :ERRORS] = contact.covariance
    errors[ERRORS, ERRORS] = rig.tolerances.encoder**2
    values, jacobian, pose_covariance = frames.in_all_frames(
        planar,
        entries,
        psi_fitted=contact.psi is not None,
        clamp_fitted=contact.base is not None,
        linear=True,
        plane=_inclination(planar, contact),
    )
    by_error = jacobian @ by_error
    return classified_estimate(
        rig,
        values,
        by_error @ errors @ by_error.T + pose_covariance,
        message,
        chi2=chi2,
        dof=dof,
        iterations=iterations,
    )


def _inclination(planar: Measurement, contact: LinearContact) -> float:
    """Return the inclination of D against C [rad], in the frame of the beam at rest."""
    if contact.psi is not None:
        return contact.psi
    return planar.handedness * (planar.rig.known_psi or 0.0)
