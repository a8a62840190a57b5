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
from solver.calibrate.calibration import UNDETERMINED
from solver.calibrate.calibration import Calibration as Calibration
from solver.calibrate.lines import line_network
from solver.calibrate.pinhole import pinhole, plane_alone
from solver.calibrate.saddles import charuco, chessboard, other_chessboard
from solver.calibrate.telecentric import telecentric
from solver.calibrate.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
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
def calibrate(board_views: Iterable[Grey], rig: Rig, quarter_turns: int = 0) -> Calibration:
    """Calibrate the camera from gray images (height, width) of the rig's board, of 8 or 16 bits.

    Views are read one after the other, and only their points are kept: a generator of views needs
    the memory of one. `quarter_turns` is the camera's roll to the nearest quarter turn; it matters
    only for a board that looks the same after a turn. Raises InputError if the views differ in
    size, if view 0 does not show the board (a chessboard as a whole, another target in good part),
    if fewer than three of several views of a pinhole do, if they determine no camera, or if the
    calibrated camera does not show the beam.
    """
    shapes: list[tuple[int, ...]] = []
    detections: list[BoardDetection | None] = []
    seen = ""
    for view in board_views:
        shapes.append(view.shape)
        if view.shape != shapes[0]:
            sizes = sorted({shapes[0], view.shape})
            raise InputError(f"the calibration views differ in size: {sizes}, allowed is one")
        detections.append(detect_board(view, rig.board, quarter_turns))
        if detections == [None]:
            seen = _seen(view, rig.board)
    if not detections:
        raise InputError("there is no calibration view, needed is at least one")
    if detections[0] is None:
        raise InputError(f"calibration view 0, which defines plane C, {seen}")
    height, width = shapes[0]
    valid = [detection for detection in detections if detection is not None]
    try:
        if rig.telecentric:
            calibration = telecentric(valid[0], width, height, rig)
        elif len(shapes) == 1 and not rig.distortion_coefficients:
            calibration = plane_alone(valid[0], width, height, rig)
        else:
            calibration = pinhole(valid, width, height, rig)
    except (cv2.error, np.linalg.LinAlgError) as error:
        raise InputError(UNDETERMINED) from error
    offsets = np.linspace(0, rig.beam.length, _BEAM_SAMPLES)[:, None] * [1.0, 0.0, 0.0]
    points = rig.base_position + offsets
    visible = calibration.camera.shows(points)
    in_image = np.abs(calibration.camera.project(points[visible]) / [width, height] - 0.5) < 0.5
    if np.mean(visible) < THRESHOLDS.min_visible or not in_image.all(axis=1).any():
        raise InputError(
            "the calibrated camera does not show the beam: it is behind the camera, beside the "
            "image or where the distortion is not one-to-one; check base.position_mm, "
            "beam.length_mm, board.square_mm, board.antenna_from_board_... and "
            "camera.distortion_coefficients in rig.json; lengths are in millimetres"
        )
    return calibration


def _seen(view: Grey, board: Board) -> str:
    """Say what a view shows in which the board was not detected."""
    if not isinstance(board, Chessboard):
        return "does not show enough of the board"
    other = other_chessboard(view, board)
    return f"shows {other}" if other else "does not show the whole board"


def ambiguous(board: Board) -> bool:
    """Return whether the board may look the same after a turn."""
    return isinstance(board, LineNetwork) or (
        isinstance(board, Chessboard) and (board.rows + board.columns) % 2 == 0
    )


def detect_board(view: Grey, board: Board, quarter_turns: int = 0) -> BoardDetection | None:
    """Detect the board's points in a view (height, width); return None if too few are visible.

    They are detected in 8 bits and refined in all bits that the view has. The board in the view is
    turned by `quarter_turns` clockwise, or counterclockwise if negative, and up to 45 degrees more.
    Raises InputError if markers show a mirrored board, or one of another size.
    """
    if quarter_turns and ambiguous(board):
        # Counterclockwise by as much, the board is upright.
        turned = detect_board(np.ascontiguousarray(np.rot90(view, quarter_turns)), board)
        return turned and BoardDetection(
            turned.numbers, _turned_back(turned.pixels, view.shape, quarter_turns)
        )
    detection: BoardDetection | None = None
    if isinstance(board, Charuco):
        detection = charuco(view, board)
    elif isinstance(board, LineNetwork):
        detection = line_network(view, board)
    elif isinstance(board, Chessboard):
        detection = chessboard(view, board)
    if detection is None or len(detection) < min(
        THRESHOLDS.min_target_points, board.columns * board.rows
    ):
        return None
    row, column = np.divmod(detection.numbers, board.columns)
    return detection if min(len(np.unique(row)), len(np.unique(column))) >= 3 else None


def _turned_back(pixels: Floats, shape: tuple[int, ...], quarter_turns: int) -> Floats:
    """Map pixels (n, 2) of an image after `np.rot90` to those of the image itself, of `shape`."""
    (u, v), (height, width) = pixels.T, shape
    match quarter_turns % 4:
        case 1:
            return np.column_stack([width - 1 - v, u])
        case 2:
            return np.column_stack([width - 1 - u, height - 1 - v])
        case 3:
            return np.column_stack([v, height - 1 - u])
    return pixels
