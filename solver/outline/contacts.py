"""Touched points of an object on its table: estimates of single frames, placed by the carriage.

Methods estimate the contact in Sigma_o, the frame of the antenna at motor angle zero. A carriage
brings the antenna to the object, and its readings place Sigma_o in the frame of the table, on
which the object is fixed. The object is touched where the beam's surface is, one radius from the
centreline against the force on the beam, which is the outward normal of a slippery object.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.image_frame import Carriage, ImageFrame, Readings
from solver.instrument.rig import Rig
from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE

# Smallest ratio of a point's variance, without the part that all contacts share, to the variance
# that its estimate states. Chosen: rounding must not make a variance zero.
_LEAST_SHARE: Final = 1e-3
# Smallest sigma of such an error [m, rad]. Chosen: without it a tolerance of zero divides by zero.
_LEAST_SIGMA: Final = 1e-9
# Errors that all contacts share: shift (x, y) [m] of Sigma_a, and its rotation about z [rad].
SHARED: Final = 3

Row = Mapping[str, float | str | None]


@dataclass(frozen=True)
class Contacts:
    """Touched points (n, 2) [m] on the table, their outward normals (n,) [rad], and their errors.

    `covariances` (n, 2, 2) are the errors of single contacts. `shared` (n, 2, 3) is the derivative
    of the points by the error of Sigma_a, which is the same in all contacts and has the sigmas
    `shared_sigmas` (3,).
    """

    frame_ids: tuple[str, ...]
    points: Floats
    normals: Floats
    covariances: Floats
    shared: Floats
    shared_sigmas: Floats

    def total_covariances(self) -> Floats:
        """Compute the covariances (n, 2, 2) of the points with all their errors."""
        by_sigma = self.shared * self.shared_sigmas
        return np.asarray(self.covariances + by_sigma @ by_sigma.transpose(0, 2, 1))


class CarriageContact(NamedTuple):
    """Contact in Sigma_o: point (2,) [m], its covariance (2, 2), direction of the force [rad].

    The direction is that in Sigma_a, which `motor_angle` [rad] turns; `carriage` places Sigma_o.
    """

    point: Floats
    covariance: Floats
    direction: float
    motor_angle: float
    carriage: Carriage


def carriage_contact(estimate: Estimate, readings: Readings) -> CarriageContact | None:
    """Return the contact of an estimate at the pose of a carriage.

    Return None where there is no contact in Sigma_o with force and covariance, no carriage or no
    motor angle.
    """
    motor_angle = estimate.values.get("motor_angle_rad", readings.motor_angle)
    carriage, names = readings.carriage, ("contact_world_x_m", "contact_world_y_m")
    known = {*names, "force_x_n", "force_y_n"} <= estimate.values.keys()
    if estimate.outcome is not Outcome.CONTACT or not known or estimate.covariance is None:
        return None
    covariance = estimate.covariance_of(*names)
    if carriage is None or motor_angle is None or not np.linalg.eigvalsh(covariance)[0] > 0:
        return None
    return CarriageContact(
        np.array([estimate.values[name] for name in names]),
        covariance,
        math.atan2(estimate.values["force_y_n"], estimate.values["force_x_n"]),
        motor_angle,
        carriage,
    )


def placed(contacts_by_name: Mapping[str, CarriageContact], rig: Rig) -> Contacts:
    """Place contacts, by the names of their frames, on the table of their object."""
    contacts = [_placed(touch, rig) for touch in contacts_by_name.values()]
    points, normals, covariances, shared = zip(*contacts, strict=True)
    return Contacts(
        tuple(contacts_by_name),
        np.array(points),
        np.array(normals),
        np.array(covariances),
        np.array(shared),
        shared_sigmas(rig),
    )


def contacts_of(rows: Iterable[Row], frames: Iterable[ImageFrame], rig: Rig) -> Contacts:
    """Place the contacts of a table of estimates on the table of their object.

    `rows` have the columns of the solver's CSV; only those with the outcome "contact" are used.
    `frames` have the readings of the carriage. Raises InputError if a reading or a column is
    missing.
    """
    by_id = {frame.frame_id: frame for frame in frames}
    by_path = {frame.path.resolve(): frame for frame in frames}
    contacts_by_name: dict[str, CarriageContact] = {}
    for row in rows:
        if row["outcome"] != Outcome.CONTACT:
            continue
        name = str(row["frame_id"])
        # Estimates of images that were given one by one have their paths in place of ids.
        frame = by_id.get(name) or by_path.get(Path(name).resolve())
        if frame is None:
            raise InputError(f"the frame {name} of the estimates is missing in the readings")
        contacts_by_name[name] = _contact_of_row(row, frame)
    if not contacts_by_name:
        raise InputError("the estimates have no frame with the outcome 'contact'")
    return placed(contacts_by_name, rig)


def _contact_of_row(row: Row, frame: ImageFrame) -> CarriageContact:
    carriage, motor_angle = frame.readings.carriage, frame.readings.motor_angle
    if carriage is None:
        raise InputError(f"the readings of frame {frame.frame_id} have no carriage_x_mm")
    if row.get("motor_angle_deg") is not None:
        motor_angle = _number(row, "motor_angle_deg") * DEGREE
    if motor_angle is None:
        raise InputError(f"frame {frame.frame_id} has no motor angle")
    x, y, x_sigma, y_sigma = (
        _number(row, f"contact_world_{name}_mm") * MILLIMETRE
        for name in ("x", "y", "x_sigma", "y_sigma")
    )
    correlation = _number(row, "contact_world_x_y_correlation")
    if not (min(x_sigma, y_sigma) > 0 and abs(correlation) < 1):
        raise InputError(
            f"frame {frame.frame_id} of the estimates has contact_world sigmas of "
            f"{x_sigma / MILLIMETRE:g} and {y_sigma / MILLIMETRE:g} mm and a correlation of "
            f"{correlation:g}, allowed are sigmas > 0 and a correlation between -1 and 1"
        )
    off_diagonal = correlation * x_sigma * y_sigma
    return CarriageContact(
        np.array([x, y]),
        np.array([[x_sigma**2, off_diagonal], [off_diagonal, y_sigma**2]]),
        math.atan2(_number(row, "force_y_n"), _number(row, "force_x_n")),
        motor_angle,
        carriage,
    )


class _Contact(NamedTuple):
    """One contact, as in `Contacts`."""

    point: Floats
    normal: float
    covariance: Floats
    shared: Floats


def _placed(touch: CarriageContact, rig: Rig) -> _Contact:
    carriage, arm = touch.carriage, touch.point
    # The error of Sigma_a is a shift, and a rotation about the board's middle: `fitting/frames.py`.
    by_sigma_a = np.column_stack([np.eye(2), _across(arm - rig.antenna_from_board[:2, 3])])
    common = by_sigma_a * shared_sigmas(rig)
    turn = turn_about_z(carriage.turn)[:2, :2]
    by_turn = turn @ _across(arm) * carriage.turn_sigma
    own = turn @ _subtracted(touch.covariance, common @ common.T) @ turn.T
    own += carriage.position_sigma**2 * np.eye(2) + np.outer(by_turn, by_turn)
    normal = touch.direction + touch.motor_angle + carriage.turn
    outward = np.array([math.cos(normal), math.sin(normal)])
    return _Contact(
        np.array([carriage.x, carriage.y]) + turn @ arm - rig.beam.radius * outward,
        normal,
        own,
        turn @ by_sigma_a,
    )


def shared_sigmas(rig: Rig) -> Floats:
    """Return the sigmas (3,) of the shift [m] and the rotation [rad] of Sigma_a."""
    tolerances = rig.tolerances
    shift = tolerances.board_translation
    return np.maximum([shift, shift, tolerances.board_rotation], _LEAST_SIGMA)


def _subtracted(covariance: Floats, part: Floats) -> Floats:
    """Subtract a part of a covariance (2, 2); what remains is positive in every direction."""
    scale = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(scale, np.linalg.solve(scale, part).T)
    values, vectors = np.linalg.eigh(np.eye(2) - whitened)
    root = scale @ vectors * np.sqrt(np.maximum(values, _LEAST_SHARE))
    return np.asarray(root @ root.T)


def _across(vector: Floats) -> Floats:
    """Rotate a vector (2,) by a right angle."""
    return np.array([-vector[1], vector[0]])


def _number(row: Row, name: str) -> float:
    value = row.get(name)
    if not isinstance(value, float):
        raise InputError(f"frame {row['frame_id']} of the estimates has no {name}")
    return value
