"""Calibration of a telecentric camera, which has no focal length, from one view of a target."""

import math

import numpy as np

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.calibration import Calibration
from solver.instrument.camera import Camera
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert


def telecentric(seen: BoardDetection, width: int, height: int, rig: Rig) -> Calibration:
    """Calibrate the camera from the detection of the board in plane C.

    The least-squares affine map from board to pixels has six numbers, just those of a scaled
    orthographic view with square pixels: magnification, rotation and a shift in the image.
    A tilted plane looks shortened, whichever way it is tilted: of the two cameras with the same
    image, the one that leans over the image's lower edge is chosen, so that points above the
    plane move up in the image. The camera's distance, and the pixel on its axis, are not
    observable either: the distance is set to the width of the field, the pixel to the image's
    middle. None of these three choices affects points on C.
    """
    board = rig.board.corners()[seen.numbers]
    design = np.column_stack([board[:, :2], np.ones(len(board))])
    solution = np.linalg.lstsq(design, seen.pixels, rcond=None)[0]
    affine, middle = solution[:2].T, solution[2]
    # The direction that the tilt does not shorten has the full magnification.
    axes, (magnification, shortened), _ = np.linalg.svd(affine)
    sine = math.sqrt(1 - (shortened / magnification) ** 2)
    out_of_plane = axes[:, 1] * math.copysign(sine, -axes[1, 1])
    right, down = np.column_stack([affine / magnification, out_of_plane])
    camera_from_board = np.eye(4)
    camera_from_board[:3, :3] = [right, down, np.cross(right, down)]
    cx, cy = (width - 1) / 2, (height - 1) / 2
    camera_from_board[:2, 3] = (middle - [cx, cy]) / magnification
    camera_from_board[2, 3] = width / magnification
    camera = Camera(
        width=width,
        height=height,
        fx=float(magnification),
        fy=float(magnification),
        cx=cx,
        cy=cy,
        camera_from_antenna=camera_from_board @ invert(rig.antenna_from_board),
        telecentric=True,
    )
    error = seen.pixels - design @ solution
    return Calibration(camera, float(np.sqrt((error**2).sum(axis=1).mean())))
