"""A rig whose camera is to be found, for the tests of calibration."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.board import Board
from solver.instrument.camera import Camera
from solver.instrument.rig import Rig, Tolerances
from solver.instrument.transforms import camera_looking_at, rigid, rotation_vector
from tests.drawn import tilted

BARREL = (-0.25, 0.1, 0.001, -0.0007, -0.02)
RATIONAL = (0.1, 0.02, -0.001, 0.0008, 0.005, 0.28, 0.03, 0.01)
BOARD_POSE = rigid(np.array([0.0, 0.0, 0.01]), np.array([0.12, 0.018, 0.0]))


def rig(board: Board, coefficients: int = 0) -> Rig:
    """A rig without tolerances, its board in the middle of the field."""
    return Rig(
        beam=Beam(0.24, 0.8e-3, circular_rigidity(200e9, 0.8e-3)),
        base_position=np.zeros(3),
        board=board,
        antenna_from_board=BOARD_POSE,
        deflects_towards=1,
        tolerances=Tolerances(**dict.fromkeys(Tolerances.__dataclass_fields__, 0.0)),
        distortion_coefficients=coefficients,
    )


def camera(lens: tuple[float, ...] = (), width: int = 320, height: int = 280) -> Camera:
    """A camera 0.36 m above the beam, its axis off the image's middle."""
    pose = camera_looking_at(np.array([0.12, 0.018, 0.36]), np.array([0.1206, 0.02, 0.0]), 0.02)
    focal = 1.55 * width
    cx, cy = width / 2 - 1.7, height / 2 + 1.2
    return Camera(width, height, focal, focal, cx, cy, pose, distortion=lens)


def board_pose(view: int) -> Floats:
    """Where the board is held: in plane C in view 0, then lower and leaning."""
    return tilted(BOARD_POSE, view, 0.02) if view else BOARD_POSE


def pose_error(found: Camera, true: Camera) -> Floats:
    """Turn (3,) [rad] and shift (3,) [m] of the board in view 0, along the camera's axes."""
    one, other = (each.camera_from_antenna @ BOARD_POSE for each in (found, true))
    turn = np.eye(4)
    turn[:3, :3] = one[:3, :3] @ other[:3, :3].T
    return np.concatenate([rotation_vector(turn), one[:3, 3] - other[:3, 3]])
