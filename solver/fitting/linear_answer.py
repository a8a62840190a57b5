"""From contact distance and load of linear theory to all that such a method answers.

The force acts across the undeformed beam in the deformation plane, f = 6 EI load; its component
along the beam is neglected as in (11), so that f stands for the whole force. The displacement at
the contact is y_c = 2 load x_c^3, eqs. (28) and (29); the contact point follows by (5) in Sigma_a
and by (1)-(4) in Sigma_o, the motor's axis passing through the clamp (assumption 4).
"""

import math
from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.transforms import turn_about_z

# A place known worse than this share of the beam's length is only an interval.
WEAK_SIGMA = 1 / 7

# Order of the errors in `LinearContact.covariance`: contact distance [m], load [1/m^2], psi, the
# clamp's dx, dy [m] and tilt, relative error of all lengths, relative error of EI.
X_C, LOAD, PSI, BASE, SCALE, RIGIDITY = 0, 1, 2, slice(3, 6), 6, 7
ERRORS = 8


@dataclass(frozen=True)
class LinearContact:
    """x_c [m] and load = f / (6 EI) [1/m^2] on D, and the clamp (dx, dy, tilt) where it was fitted.

    `psi` [rad] is None where the method does not estimate it. `covariance` (8, 8) is that of the
    errors in the order given above.
    """

    x_c: float
    load: float
    covariance: Floats
    psi: float | None = None
    base: tuple[float, float, float] = (0.0, 0.0, 0.0)


def errors_of_planar_fit(
    measurement: Measurement, points_part: Floats, by_base: Floats | None
) -> Floats:
    """Covariance (8, 8) of an estimate that takes the clamp, the scale and EI as they are stated.

    `points_part` (2, 2) is the covariance of (x_c, load) by the points' noise, `by_base` (2, 3)
    their derivative by the clamp's true pose.
    """
    covariance = stated_errors(measurement)
    base = measurement.base_covariance
    if by_base is not None:
        covariance[:2, :2] = by_base @ base @ by_base.T
        # Believed at rest, a clamp at (dx, dy, tilt) errs by just that, to the other side.
        covariance[:2, BASE] = -by_base @ base
        covariance[BASE, :2] = covariance[:2, BASE].T
    covariance[:2, :2] += points_part
    return covariance


def stated_errors(measurement: Measurement) -> Floats:
    """Covariance (8, 8) of what the rig and the measurement state: clamp, scale, EI."""
    covariance = np.zeros((ERRORS, ERRORS))
    covariance[BASE, BASE] = measurement.base_covariance
    covariance[SCALE, SCALE] = measurement.scale_sigma**2
    rig = measurement.rig
    relative = rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity
    covariance[RIGIDITY, RIGIDITY] = relative**2
    return covariance


def answer(
    contact: LinearContact,
    planar: Measurement,
    message: str = "",
    *,
    chi2: float | None = None,
    dof: int | None = None,
    iterations: int | None = None,
) -> Estimate:
    """The estimate of a contact found on `planar`, the measurement carried onto D."""
    values, jacobian = _values(contact, planar)
    tolerances, length = planar.rig.tolerances, planar.rig.beam.length
    sources = np.zeros((ERRORS + 2, ERRORS + 2))
    sources[:ERRORS, :ERRORS] = contact.covariance
    sources[ERRORS, ERRORS] = tolerances.encoder**2
    sources[ERRORS + 1, ERRORS + 1] = tolerances.base_position**2 + tolerances.board_translation**2
    covariance = jacobian @ sources @ jacobian.T
    sigma = math.sqrt(max(float(covariance[0, 0]), 0.0))
    outcome = Outcome.CONTACT
    if sigma > WEAK_SIGMA * length:
        outcome = Outcome.WEAK_CONTACT
    elif contact.x_c > length - 2 * math.hypot(sigma, tolerances.beam_length):
        outcome = Outcome.TIP_CONTACT
    return Estimate(
        outcome,
        message,
        values=values,
        covariance=(covariance + covariance.T) / 2,
        chi2=chi2,
        dof=dof,
        iterations=iterations,
    )


def _values(contact: LinearContact, planar: Measurement) -> tuple[dict[str, float], Floats]:
    """The named values, and their derivative (k, 10) by errors, motor's angle and height."""
    rig, x_c, load = planar.rig, contact.x_c, contact.load
    force = 6 * rig.beam.flexural_rigidity * load
    y_c = 2 * load * x_c**3
    axes = planar.antenna_from_beam[:3, :3]
    dx, dy, tilt = contact.base
    place = np.array([x_c + dx - tilt * y_c, y_c + dy + tilt * x_c, 0.0])
    point = axes @ place + planar.antenna_from_beam[:3, 3]

    # Derivatives by the eight errors, the motor's angle, and the clamp's height.
    def by(**parts: float) -> Floats:
        row = np.zeros(ERRORS + 2)
        for name, value in parts.items():
            row[_COLUMNS[name]] = value
        return row

    by_x_c = by(x_c=1.0, scale=x_c)
    by_y_c = by(x_c=3 * y_c / x_c, load=2 * x_c**3, scale=y_c)
    by_force = by(load=force / load, scale=-2 * force, rigidity=force)
    normal = by(psi=1.0)
    along = by_x_c + by(dx=1.0, tilt=-y_c)
    across = by_y_c + by(dy=1.0, tilt=x_c)
    by_point = axes @ np.vstack([along, across, y_c * normal]) + np.array(
        [by(), by(), by(height=1.0)]
    )
    force_axes = axes[:, 1]
    by_push = np.outer(force_axes, by_force) + np.outer(axes[:, 2], force * normal)
    by_shift = np.outer(force_axes, by_y_c) + np.outer(axes[:, 2], y_c * normal)

    values = {"x_c_m": x_c, "y_c_m": y_c, "force_n": force, "f_n": force}
    rows = [by_x_c, by_y_c, by_force, by_force]
    if contact.psi is not None:
        side = float(np.sign(np.linalg.det(axes)))
        values["psi_rad"] = side * contact.psi
        rows.append(side * normal)
    for i, axis in enumerate("xyz"):
        values[f"contact_antenna_{axis}_m"] = float(point[i])
        rows.append(by_point[i])
    if planar.motor_angle is not None:
        # Eq. (4) turns about the clamp, where the motor's axis passes.
        turn = turn_about_z(planar.motor_angle)[:3, :3]
        arm = point - rig.base_position
        in_world = turn @ arm + rig.base_position
        by_world = turn @ by_point
        by_world += np.outer(turn @ np.array([-arm[1], arm[0], 0.0]), by(motor=1.0))
        for i, axis in enumerate("xyz"):
            values[f"contact_world_{axis}_m"] = float(in_world[i])
            rows.append(by_world[i])
    for i, axis in ((1, "y"), (2, "z")):
        values[f"force_{axis}_n"] = force * float(force_axes[i])
        rows.append(by_push[i])
    for i, axis in ((1, "y"), (2, "z")):
        values[f"displacement_{axis}_m"] = y_c * float(force_axes[i])
        rows.append(by_shift[i])

    return values, np.vstack(rows)


_COLUMNS = {
    "x_c": X_C,
    "load": LOAD,
    "psi": PSI,
    "dx": 3,
    "dy": 4,
    "tilt": 5,
    "scale": SCALE,
    "rigidity": RIGIDITY,
    "motor": ERRORS,
    "height": ERRORS + 1,
}
