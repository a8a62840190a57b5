"""Calibrate a camera from board views: intrinsics, distortion, and the pose of plane C.

View 0 shows the board lying in plane C at the pose that the rig states. The other views tilt the
board, which makes a pinhole's focal length observable; with view 0 alone, plane C is known and the
viewpoint is not. A telecentric camera has no focal length and is calibrated from view 0.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import cv2
import numpy as np

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.calibration import Calibration as Calibration
from solver.calibrate.lines import line_network
from solver.calibrate.pinhole import pinhole
from solver.calibrate.plane_alone import plane_alone
from solver.calibrate.saddles import charuco, chessboard
from solver.calibrate.telecentric import telecentric
from solver.calibrate.thresholds import LIMITS
from solver.instrument.arrays import Grey
from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig

# Number of points along the beam at rest whose visibility is tested.
_BEAM_SAMPLES = 20


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limit OpenCV to one thread.

    OpenCV adds up the normal equations in the order in which its threads finish; one thread gives
    the same bits every time.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


@_one_thread()
def calibrate(board_views: Iterable[Grey], rig: Rig) -> Calibration:
    """Calibrate the camera from gray images (height, width) of the rig's board, of 8 or 16 bits.

    Views are read one after the other, and only their points are kept: a generator of views needs
    the memory of one. Raises InputError if the views differ in size, if view 0 does not show the
    board (a chessboard as a whole, another target in good part), if fewer than three of several
    views of a pinhole do, if they determine no camera, or if the calibrated camera does not show
    the beam.
    """
    shapes: list[tuple[int, ...]] = []
    detections: list[BoardDetection | None] = []
    for view in board_views:
        shapes.append(view.shape)
        if view.shape != shapes[0]:
            sizes = sorted({shapes[0], view.shape})
            raise InputError(f"the calibration views differ in size: {sizes}, allowed is one")
        detections.append(detect_board(view, rig.board))
    if not detections:
        raise InputError("there is no calibration view, needed is at least one")
    if detections[0] is None:
        required = "the whole board" if isinstance(rig.board, Chessboard) else "enough of the board"
        raise InputError(f"calibration view 0, which defines plane C, does not show {required}")
    height, width = shapes[0]
    valid = [detection for detection in detections if detection is not None]
    try:
        if rig.telecentric:
            calibration = telecentric(valid[0], width, height, rig)
        elif len(shapes) == 1 and not rig.distortion_coefficients:
            calibration = plane_alone(valid[0], width, height, rig)
        else:
            calibration = pinhole(valid, width, height, rig)
    except (cv2.error, np.linalg.LinAlgError, ValueError) as error:
        raise InputError(
            "the calibration views do not determine the camera: check the board's size in "
            "rig.json, and tilt the board differently in each view but the first"
        ) from error
    offsets = np.linspace(0, rig.beam.length, _BEAM_SAMPLES)[:, None] * [1.0, 0.0, 0.0]
    points = rig.base_position + offsets
    visible = calibration.camera.shows(points)
    in_image = np.abs(calibration.camera.project(points[visible]) / [width, height] - 0.5) < 0.5
    if np.mean(visible) < LIMITS.min_visible or not in_image.all(axis=1).any():
        raise InputError(
            "the calibrated camera does not show the beam: it is behind the camera, beside the "
            "image or where the distortion is not one-to-one; check base.position_mm, "
            "board.antenna_from_board_... and camera.distortion_coefficients in rig.json"
        )
    return calibration


def detect_board(view: Grey, board: Board) -> BoardDetection | None:
    """Detect the board's points in a view (height, width); return None if too few are visible.

    They are detected in 8 bits and refined in all bits that the view has.
    """
    detection: BoardDetection | None = None
    if isinstance(board, Charuco):
        detection = charuco(view, board)
    elif isinstance(board, LineNetwork):
        detection = line_network(view, board)
    elif isinstance(board, Chessboard):
        detection = chessboard(view, board)
    if detection is None or len(detection) < min(
        LIMITS.min_target_points, board.columns * board.rows
    ):
        return None
    row, column = np.divmod(detection.numbers, board.columns)
    return detection if min(len(np.unique(row)), len(np.unique(column))) >= 3 else None
