"""Transform a contact from Sigma_d through the clamp into Sigma_a and Sigma_o.

The contact (x_c, y_c) and the force are given in the deformation frame; only friction inclines the
force against the beam's normal. Both are rotated by the inclination psi about the beam at rest and
by the clamp's tilt in plane C, and translated to the clamp's position: eq. (5). The rig states
where the clamp is relative to the motor's axis, about which eqs. (1) and (4) rotate; by default it
is on the axis (assumption 4). A camera fixed in the world observes Sigma_o; there the clamp's tilt
is the motor angle, by which Sigma_a has turned, and the clamp is on the axis.

Sigma_a is known only as accurately as the board's pose in it during camera calibration. Its error
is a shift by the rig's tolerance of the board's translation, and a rotation about the board's
middle by that of the board's rotation. The clamp's height over plane C has the tolerance of the
clamp's position. The clamp's offset from the axis has the covariance that the rig states.

Where the image shows the clamp elsewhere than at rest, the clamp may have moved or the image may
have shifted: the camera was knocked, or all points share an error. The fitted displacement is
divided between both in proportion to their covariances, and only the clamp's part moves the contact
in Sigma_a and Sigma_o. The clamp's place is that of the beam's axis, which the light hides: the
apparent middle at rest is beside it.
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
# Values of the third dimension; they are unknown where the plane is only assumed.
_SPATIAL: Final = frozenset({"psi_rad", "force_z_n", "displacement_z_m"})
_WORLD: Final = frozenset({"contact_world_x_m", "contact_world_y_m", "contact_world_z_m"})
# Linear theory neglects the force along the beam, and that the beam foreshortens.
_LARGE_DEFLECTION: Final = frozenset({"s_c_m", "theta_c_rad", "force_x_n"})
Vector = tuple[float, float, float]
# Entries of a contact vector, in this order: lengths [m], force [N], angles [rad]. LEAN is the
# angle of the force from the beam's normal, back to the clamp.
X_C, Y_C, S_C, FORCE, THETA, PSI, DX, DY, TILT, ANGLE, LEAN = range(11)
CONTACT: Final = 11
# The error of Sigma_a follows: shift (3,), rotation (3,) about the board's middle; and then the
# clamp's offset (2,) from the motor's axis.
_POSE_ERRORS: Final = 6
_OFFSET: Final = CONTACT + _POSE_ERRORS
_SHIFT: Final = _POSE_ERRORS + 2
_CLAMP: Final = slice(DX, DY + 1)
_CLAMP_POSE: Final = slice(DX, TILT + 1)


def tilt_is_motor_angle(measurement: Measurement) -> bool:
    """Test whether the clamp's tilt is the motor angle, as for a camera fixed in the world."""
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
    """Compute values (m,) by name, Jacobian (m, 11) by contact, covariance (m, m) by poses.

    The arguments are those of `with_jacobians`.
    """
    values, by_contact, by_pose = with_jacobians(
        measurement,
        contact,
        psi_fitted=psi_fitted,
        clamp_fitted=clamp_fitted,
        linear=linear,
        plane=plane,
    )
    return values, by_contact, pose_covariance(measurement, by_pose)


def with_jacobians(
    measurement: Measurement,
    contact: Floats,
    *,
    psi_fitted: bool = False,
    clamp_fitted: bool = False,
    linear: bool = False,
    plane: float = 0.0,
) -> tuple[dict[str, float], Floats, Floats]:
    """Compute values (m,) by name, Jacobians (m, 11) by contact and (m, 10) by the rig's poses.

    `contact` (11,) is (x_c, y_c, s_c, force, theta_c, psi, dx, dy, tilt, motor angle, lean) in the
    frame of the beam at rest; `measurement` may already be un-projected onto a plane inclined by
    `plane` [rad]. Values that are not estimated are absent: the third dimension if psi was neither
    fitted nor stated by the rig, Sigma_o if neither the encoder nor a fitted clamp gives the motor
    angle, and with `linear` the values that linear theory neglects. The rig's poses are the error
    of Sigma_a (6,), the clamp's offset (2,) from the motor's axis, and the part (2,) of the clamp's
    displacement that the image does not show.
    """
    shift_by_clamp = measurement.shift_by_clamp
    moved = contact.copy()
    moved[_CLAMP] -= shift_by_clamp @ contact[_CLAMP_POSE]
    rig, world_camera = measurement.rig, tilt_is_motor_angle(measurement)
    # Copies: read-only arrays, as a rig has them unless another process sent it, are another type,
    # for which the function would be compiled again.
    values, by_contact, by_pose = _with_jacobian(
        moved,
        rig.beam.length,
        measurement.antenna_from_beam,
        rig.antenna_from_board.copy(),
        rig.clamp_offset.position.copy(),
        measurement.handedness,
        plane,
        world_camera,
    )
    by_pose = np.hstack([by_pose, by_contact[:, _CLAMP]])
    by_contact[:, _CLAMP_POSE] -= by_contact[:, _CLAMP] @ shift_by_clamp
    by_tilt = world_camera and clamp_fitted
    indices, names = _estimated(
        psi_fitted or rig.known_psi is not None,
        by_tilt or measurement.motor_angle is not None,
        by_tilt,
        linear,
    )
    return (
        dict(zip(names, values[indices].tolist(), strict=True)),
        np.asarray(by_contact[indices]),
        np.asarray(by_pose[indices]),
    )


def pose_covariance(measurement: Measurement, by_pose: Floats) -> Floats:
    """Compute the covariance (m, m), due to the rig's poses, of values with Jacobian (m, 10)."""
    tolerances = measurement.rig.tolerances
    shift, rotation = tolerances.board_translation**2, tolerances.board_rotation**2
    variances = np.array((shift, shift, shift + tolerances.base_position**2, *[rotation] * 3))
    of_frame, by_offset = by_pose[:, :_POSE_ERRORS], by_pose[:, _POSE_ERRORS:_SHIFT]
    by_shift = by_pose[:, _SHIFT:]
    offset = measurement.rig.clamp_offset.covariance
    shift_of_image, by_clamp = measurement.image_shift, measurement.shift_by_clamp
    # What the clamp's pose does not show, and that of the axis about its apparent middle.
    unexplained = shift_of_image - by_clamp[:, :2] @ shift_of_image
    unexplained[1, 1] += measurement.axis_sigma**2
    return np.asarray(
        (of_frame * variances) @ of_frame.T
        + by_offset @ offset @ by_offset.T
        + by_shift @ unexplained @ by_shift.T
    )


@lru_cache
def _estimated(
    spatial: bool, world: bool, motor: bool, linear: bool
) -> tuple[npt.NDArray[np.int64], tuple[str, ...]]:
    """Return the indices of the estimated NAMES, and these names."""
    absent = _LARGE_DEFLECTION if linear else frozenset()
    absent |= frozenset() if spatial else _SPATIAL
    absent |= frozenset() if world else _WORLD
    absent |= frozenset() if motor else {"motor_angle_rad"}
    indices = [i for i, name in enumerate(NAMES) if name not in absent]
    return np.array(indices), tuple(NAMES[i] for i in indices)


@njit(inline="always")
def _rotated(angle: float, vector: Vector) -> Vector:
    """Rotate a vector about z."""
    c, s = math.cos(angle), math.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]


@njit(inline="always")
def _cross(rotation: Floats, vector: Vector) -> Vector:
    return (
        rotation[1] * vector[2] - rotation[2] * vector[1],
        rotation[2] * vector[0] - rotation[0] * vector[2],
        rotation[0] * vector[1] - rotation[1] * vector[0],
    )


@njit(inline="always")
def _to_antenna(axes: Floats, rotation: Floats, vector: Vector) -> Vector:
    """Rotate from the beam's frame to Sigma_a, with the small rotation error `rotation`."""
    x = axes[0, 0] * vector[0] + axes[0, 1] * vector[1] + axes[0, 2] * vector[2]
    y = axes[1, 0] * vector[0] + axes[1, 1] * vector[1] + axes[1, 2] * vector[2]
    z = axes[2, 0] * vector[0] + axes[2, 1] * vector[1] + axes[2, 2] * vector[2]
    change = _cross(rotation, (x, y, z))
    return x + change[0], y + change[1], z + change[2]


@njit
def _values(
    v: Floats,
    antenna_from_beam: Floats,
    antenna_from_board: Floats,
    handedness: int,
    plane: float,
    world_camera: bool,
    scratch: Floats,
    out: Floats,
) -> None:
    """Write the values of NAMES to `out`; `scratch` is (3, 3)."""
    x, y, force, theta, psi, tilt = v[X_C], v[Y_C], v[FORCE], v[THETA], v[PSI], v[TILT]
    direction = theta + v[LEAN]
    across, along = force * math.cos(direction), -force * math.sin(direction)
    cosine, sine = math.cos(psi), math.sin(psi)
    # A camera fixed in the world observes Sigma_o; Sigma_a has turned.
    angle = handedness * tilt if world_camera else v[ANGLE]
    turn = -angle if world_camera else 0.0
    shift, rotation = v[CONTACT : CONTACT + 3], v[CONTACT + 3 :]
    # Vectors from the clamp, in Sigma_a as given by the board.
    vectors = (
        (x, y * cosine, y * sine),  # to the contact
        (along, across * cosine, across * sine),  # the force
        (0.0, y * cosine, y * sine),  # the displacement
    )
    for k in range(3):
        vector = _to_antenna(antenna_from_beam, rotation, _rotated(tilt, vectors[k]))
        vector = _rotated(turn, vector)
        scratch[k, 0], scratch[k, 1], scratch[k, 2] = vector
    contact, force_vector, displacement = scratch[0], scratch[1], scratch[2]
    clamp_offset = _to_antenna(antenna_from_beam, rotation, (v[DX], v[DY], 0.0))
    origin, board_middle = antenna_from_beam[:3, 3], antenna_from_board[:3, 3]
    clamp_shift = _cross(
        rotation,
        (origin[0] - board_middle[0], origin[1] - board_middle[1], origin[2] - board_middle[2]),
    )
    if world_camera:
        world_contact = _rotated(angle, (contact[0], contact[1], contact[2]))
    else:
        # About the motor's axis; the clamp's position in the image turns with the camera.
        axis_x, axis_y = v[_OFFSET], v[_OFFSET + 1]
        from_axis = (
            contact[0] + clamp_offset[0] + axis_x,
            contact[1] + clamp_offset[1] + axis_y,
            contact[2],
        )
        turned = _rotated(angle, from_axis)
        world_contact = (
            turned[0] - axis_x - clamp_offset[0],
            turned[1] - axis_y - clamp_offset[1],
            turned[2],
        )
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, v[S_C], force, across, theta
    out[6] = handedness * (plane + psi)
    for i in range(3):
        clamp = origin[i] + clamp_offset[i] + shift[i] + clamp_shift[i]
        out[7 + i], out[10 + i] = clamp + contact[i], clamp + world_contact[i]
        out[13 + i] = force_vector[i]
    out[16], out[17], out[18] = displacement[1], displacement[2], angle


@njit
def _with_jacobian(
    contact: Floats,
    length: float,
    antenna_from_beam: Floats,
    antenna_from_board: Floats,
    axis_offset: Floats,
    handedness: int,
    plane: float,
    world_camera: bool,
) -> Any:
    """Compute values (n,) and Jacobians by contact (n, 11) and by the rig's poses (n, 8).

    The Jacobians are central differences, with a relative error of 1e-10.
    """
    inputs, steps = np.zeros(_OFFSET + 2), np.ones(_OFFSET + 2)
    for j in range(CONTACT):
        inputs[j] = contact[j]
    inputs[_OFFSET], inputs[_OFFSET + 1] = axis_offset
    for j in (X_C, Y_C, S_C, DX, DY, CONTACT, CONTACT + 1, CONTACT + 2, _OFFSET, _OFFSET + 1):
        steps[j] = length
    steps[FORCE] = max(abs(contact[FORCE]), 1e-300)
    n, scratch = len(NAMES), np.empty((3, 3))
    # The values at the inputs, ahead of and behind them.
    values, jacobian = np.empty((3, n)), np.empty((n, len(inputs)))
    for j in range(len(inputs)):
        centre, step = inputs[j], 1e-5 * steps[j]
        for side in range(3):
            inputs[j] = centre + (0.0, step, -step)[side]
            _values(
                inputs, antenna_from_beam, antenna_from_board, handedness, plane, world_camera,
                scratch, values[side],
            )  # fmt: skip
        inputs[j] = centre
        for i in range(n):
            jacobian[i, j] = (values[1, i] - values[2, i]) / (2 * step)
    return values[0], jacobian[:, :CONTACT], jacobian[:, CONTACT:]
