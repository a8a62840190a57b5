"""Rigid transforms as 4 x 4 matrices, always named target_from_source.

Frames: Sigma_o world; Sigma_a antenna (x along the undeformed beam from its clamp, z along
the motor's axis towards the camera); Sigma_d deformation (x shared with Sigma_a).
"""

import math

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from solver.instrument.arrays import Floats


def rigid(rotation_vector: npt.ArrayLike, translation: npt.ArrayLike) -> Floats:
    """Make a matrix (4, 4) from a rotation vector (3,) [rad] and a translation (3,) [m]."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(np.asarray(rotation_vector, dtype=float)).as_matrix()
    matrix[:3, 3] = translation
    return matrix


def rotation_vector(transform: Floats) -> Floats:
    """Compute the rotation vector (3,) [rad] of a rigid transform (4, 4)."""
    return np.asarray(Rotation.from_matrix(transform[:3, :3]).as_rotvec())


def invert(transform: Floats) -> Floats:
    """Invert a rigid target_from_source (4, 4) to source_from_target (4, 4)."""
    rotation = transform[:3, :3].T
    inverse = np.eye(4)
    inverse[:3, :3] = rotation
    inverse[:3, 3] = -rotation @ transform[:3, 3]
    return inverse


def apply(transform: Floats, points: Floats) -> Floats:
    """Transform points (n, 3) by target_from_source (4, 4)."""
    return np.asarray(points @ transform[:3, :3].T + transform[:3, 3])


def turn_about_z(angle_rad: float) -> Floats:
    """Make the rotation (4, 4) by `angle_rad` about the motor's axis, eq. (4)."""
    return rigid(np.array([0.0, 0.0, angle_rad]), np.zeros(3))


def camera_looking_at(position: Floats, target: Floats, roll_rad: float) -> Floats:
    """Make camera_from_antenna (4, 4) of a camera at `position` aimed at `target`, both (3,) [m].

    Without roll the image's u axis follows +x of Sigma_a; roll rotates the camera about its
    axis. Camera axes are OpenCV's: x right, y down, z forward. Raises ValueError if the
    camera looks along x, where "right" is undefined.
    """
    forward = np.asarray(target, dtype=float) - np.asarray(position, dtype=float)
    distance = float(np.linalg.norm(forward))
    if distance == 0 or math.hypot(forward[1], forward[2]) < 1e-6 * distance:
        raise ValueError("the camera must not look along the beam's own direction")
    forward /= distance
    right = np.array([1.0, 0.0, 0.0]) - forward[0] * forward
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    antenna_from_camera = np.eye(4)
    antenna_from_camera[:3, :3] = np.column_stack([right, down, forward])
    antenna_from_camera[:3, 3] = position
    rolled = antenna_from_camera @ turn_about_z(roll_rad)
    return invert(rolled)
