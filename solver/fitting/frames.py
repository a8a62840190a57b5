"""A contact in all frames of reference: from Sigma_d through the clamp into Sigma_a and Sigma_o.

The contact (x_c, y_c) and the force of the deformation frame, which leans off the beam's normal
only by friction, are turned by the inclination psi about the beam at rest, by the clamp's tilt in
plane C, and carried to where the clamp stands: eq. (5). The motor's axis passes through the clamp
(assumption 4), wherever that stands in Sigma_a, so that eqs. (1) and (4) turn about the clamp. A
camera that stands in the world sees Sigma_o; there the clamp's tilt is the motor's angle, by which
Sigma_a has turned.

Sigma_a itself is known only as well as the board lay in it when the camera was calibrated: shifted
by the rig's tolerance of its translation, turned about the board's middle by that of its rotation,
and the clamp stands over plane C as its own place is known.
"""

import math
from functools import lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.measurement import Measurement

NAMES: Final = (
    "x_c_m", "y_c_m", "s_c_m", "force_n", "f_n", "theta_c_rad", "psi_rad",
    "contact_antenna_x_m", "contact_antenna_y_m", "contact_antenna_z_m",
    "contact_world_x_m", "contact_world_y_m", "contact_world_z_m",
    "force_x_n", "force_y_n", "force_z_n", "displacement_y_m", "displacement_z_m",
    "motor_angle_rad",
)  # fmt: skip
# What is said of the third dimension; in a plane that is merely assumed nothing is known of it.
_SPATIAL: Final = frozenset({"psi_rad", "force_z_n", "displacement_z_m"})
_WORLD: Final = frozenset({"contact_world_x_m", "contact_world_y_m", "contact_world_z_m"})
# Linear theory neglects the force along the beam, and that the beam foreshortens.
_LARGE: Final = frozenset({"s_c_m", "theta_c_rad", "force_x_n"})
Vector = tuple[float, float, float]
# What a contact is told by, in this order: lengths [m], force [N], angles [rad]. LEAN is how far
# the force leans off the beam's normal, back to the clamp.
X_C, Y_C, S_C, FORCE, THETA, PSI, DX, DY, TILT, ANGLE, LEAN = range(11)
CONTACT: Final = 11
# Behind them the error of Sigma_a: a shift (3,) and a turn (3,) about the board's middle.
_PLACED: Final = 6


def stands_in_world(measurement: Measurement) -> bool:
    """Whether the clamp's tilt is the motor's angle, for the camera does not turn with it."""
    return measurement.motor_angle is None and measurement.rig.camera_mount == "world"


def in_all_frames(
    measurement: Measurement,
    contact: Floats,
    *,
    psi_fitted: bool = False,
    clamp_fitted: bool = False,
    linear: bool = False,
    plane: float = 0.0,
) -> tuple[dict[str, float], Floats, Floats]:
    """Values (m,) by name, their Jacobian (m, 11) by the contact, and what Sigma_a adds (m, m).

    `contact` (11,) is (x_c, y_c, s_c, force, theta_c, psi, dx, dy, tilt, motor angle, lean) in the
    frame of the beam at rest; `measurement` may have been carried onto a plane that is inclined by
    `plane` [rad] already. The last matrix is the covariance that an error of Sigma_a gives the
    values. What is not estimated is absent: the third dimension where psi was neither fitted nor
    stated by the rig, Sigma_o where neither the encoder nor a fitted clamp tells the motor's angle,
    and with `linear` what linear theory neglects.
    """
    rig, standing = measurement.rig, stands_in_world(measurement)
    values, by_contact, by_place = _with_jacobian(
        contact,
        rig.beam.length,
        measurement.antenna_from_beam,
        rig.antenna_from_board,
        measurement.handedness,
        plane,
        standing,
    )
    by_tilt = standing and clamp_fitted
    told, names = _told(
        psi_fitted or rig.known_psi is not None,
        by_tilt or measurement.motor_angle is not None,
        by_tilt,
        linear,
    )
    tolerances = rig.tolerances
    placed = np.full(_PLACED, tolerances.board_translation**2)
    placed[2] += tolerances.base_position**2
    placed[3:] = tolerances.board_rotation**2
    by_place = by_place[told]
    return (
        dict(zip(names, values[told].tolist(), strict=True)),
        np.asarray(by_contact[told]),
        np.asarray((by_place * placed) @ by_place.T),
    )


@lru_cache
def _told(
    spatial: bool, world: bool, motor: bool, linear: bool
) -> tuple[npt.NDArray[np.int64], tuple[str, ...]]:
    """Which of NAMES are told, and these."""
    absent = _LARGE if linear else frozenset()
    absent |= frozenset() if spatial else _SPATIAL
    absent |= frozenset() if world else _WORLD
    absent |= frozenset() if motor else {"motor_angle_rad"}
    told = [i for i, name in enumerate(NAMES) if name not in absent]
    return np.array(told), tuple(NAMES[i] for i in told)


@njit(inline="always")
def _turned(angle: float, vector: Vector) -> Vector:
    """Turned about z."""
    c, s = math.cos(angle), math.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]


@njit(inline="always")
def _cross(turn: Floats, vector: Vector) -> Vector:
    return (
        turn[1] * vector[2] - turn[2] * vector[1],
        turn[2] * vector[0] - turn[0] * vector[2],
        turn[0] * vector[1] - turn[1] * vector[0],
    )


@njit(inline="always")
def _carried(axes: Floats, turn: Floats, vector: Vector) -> Vector:
    """Out of the beam's frame, in the axes of a Sigma_a that errs by a small turn."""
    x = axes[0, 0] * vector[0] + axes[0, 1] * vector[1] + axes[0, 2] * vector[2]
    y = axes[1, 0] * vector[0] + axes[1, 1] * vector[1] + axes[1, 2] * vector[2]
    z = axes[2, 0] * vector[0] + axes[2, 1] * vector[1] + axes[2, 2] * vector[2]
    by_turn = _cross(turn, (x, y, z))
    return x + by_turn[0], y + by_turn[1], z + by_turn[2]


@njit(cache=True, error_model="numpy")
def _values(
    v: Floats,
    antenna_from_beam: Floats,
    antenna_from_board: Floats,
    handed: int,
    plane: float,
    standing: bool,
    out: Floats,
) -> None:
    """The values of NAMES into `out`."""
    x, y, force, theta, psi, tilt = v[X_C], v[Y_C], v[FORCE], v[THETA], v[PSI], v[TILT]
    direction = theta + v[LEAN]
    across, along = force * math.cos(direction), -force * math.sin(direction)
    cosine, sine = math.cos(psi), math.sin(psi)
    shift, turn = v[CONTACT : CONTACT + 3], v[CONTACT + 3 :]
    # From the clamp, in Sigma_a as the board has it.
    arm = _carried(antenna_from_beam, turn, _turned(tilt, (x, y * cosine, y * sine)))
    push = _carried(antenna_from_beam, turn, _turned(tilt, (along, across * cosine, across * sine)))
    moved = _carried(antenna_from_beam, turn, _turned(tilt, (0.0, y * cosine, y * sine)))
    stands = _carried(antenna_from_beam, turn, (v[DX], v[DY], 0.0))
    origin, middle = antenna_from_beam[:3, 3], antenna_from_board[:3, 3]
    lever = _cross(turn, (origin[0] - middle[0], origin[1] - middle[1], origin[2] - middle[2]))
    angle = v[ANGLE]
    if standing:  # what is seen is the world's, and Sigma_a has turned
        angle = handed * tilt
        arm, push, moved = _turned(-angle, arm), _turned(-angle, push), _turned(-angle, moved)
    there = _turned(angle, arm)
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, v[S_C], force, across, theta
    out[6] = handed * (plane + psi)
    for i in range(3):
        clamp = origin[i] + stands[i] + shift[i] + lever[i]
        out[7 + i], out[10 + i], out[13 + i] = clamp + arm[i], clamp + there[i], push[i]
    out[16], out[17], out[18] = moved[1], moved[2], angle


@njit(cache=True, error_model="numpy")
def _with_jacobian(
    contact: Floats,
    length: float,
    antenna_from_beam: Floats,
    antenna_from_board: Floats,
    handed: int,
    plane: float,
    standing: bool,
) -> Any:
    """Values (n,), and their Jacobians by the contact (n, 11) and by the error of Sigma_a (n, 6).

    By central differences, which lose 1e-10 of them.
    """
    inputs, steps = np.zeros(CONTACT + _PLACED), np.ones(CONTACT + _PLACED)
    inputs[:CONTACT] = contact
    for j in (X_C, Y_C, S_C, DX, DY, CONTACT, CONTACT + 1, CONTACT + 2):
        steps[j] = length
    steps[FORCE] = max(contact[FORCE], 1e-300)
    steps *= 1e-5
    n = len(NAMES)
    values, ahead, behind = np.empty(n), np.empty(n), np.empty(n)
    _values(inputs, antenna_from_beam, antenna_from_board, handed, plane, standing, values)
    jacobian = np.empty((n, len(inputs)))
    for j in range(len(inputs)):
        here = inputs[j]
        inputs[j] = here + steps[j]
        _values(inputs, antenna_from_beam, antenna_from_board, handed, plane, standing, ahead)
        inputs[j] = here - steps[j]
        _values(inputs, antenna_from_beam, antenna_from_board, handed, plane, standing, behind)
        inputs[j] = here
        jacobian[:, j] = (ahead - behind) / (2 * steps[j])
    return values, jacobian[:, :CONTACT], jacobian[:, CONTACT:]
