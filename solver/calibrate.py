"""Board views -> camera: intrinsics, and the pose of the calibration plane C.

Zhang (2000), as OpenCV does it. View 0 shows the board lying in plane C at the pose that the
rig states; the other views tilt it, which is what makes the focal length observable.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Grey
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.rig import Chessboard, Rig
from solver.instrument.transforms import invert, rigid

BLUR_PX = 1.5


@dataclass(frozen=True)
class Calibration:
    """The camera as found, and the root mean square reprojection error of the corners [px]."""

    camera: Camera
    reprojection_px: float


@contextmanager
def _one_thread() -> Iterator[None]:
    """OpenCV adds up the normal equations in the order in which its threads finish; one thread
    gives the same bits every time."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


@_one_thread()
def calibrate(board_views: Sequence[Grey], rig: Rig) -> Calibration:
    """Camera from gray images (height, width) of the rig's board.

    Raises InputError if the views differ in size, view 0 does not show the whole board, or
    fewer than three views do.
    """
    sizes = {view.shape for view in board_views}
    if len(sizes) != 1:
        raise InputError(f"the calibration views differ in size: {sorted(sizes)}, allowed is one")
    found = [_corners(view, rig.board) for view in board_views]
    if found[0] is None:
        raise InputError("calibration view 0, which defines plane C, does not show the whole board")
    corners = [pixels for pixels in found if pixels is not None]
    if len(corners) < 3:
        raise InputError(f"{len(corners)} calibration views show the whole board, needed are 3")
    height, width = board_views[0].shape
    board = rig.board.corners().astype(np.float32)
    # No lens distortion: the rig's camera has none, and free coefficients would trade against
    # the focal length. A common focal length: the pixels are square.
    flags = (
        cv2.CALIB_FIX_ASPECT_RATIO
        | cv2.CALIB_ZERO_TANGENT_DIST
        | cv2.CALIB_FIX_K1
        | cv2.CALIB_FIX_K2
        | cv2.CALIB_FIX_K3
    )
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-12)
    start = np.array([[width, 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1.0]])
    error, matrix, _, rotations, translations = cv2.calibrateCamera(
        [board] * len(corners),
        corners,
        (width, height),
        start,
        np.zeros(5),
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=criteria,
    )
    camera_from_board = rigid(rotations[0].ravel(), translations[0].ravel())
    camera = Camera(
        width=width,
        height=height,
        fx=float(matrix[0, 0]),
        fy=float(matrix[1, 1]),
        cx=float(matrix[0, 2]),
        cy=float(matrix[1, 2]),
        camera_from_antenna=camera_from_board @ invert(rig.antenna_from_board),
    )
    return Calibration(camera, float(error))


def _corners(view: Grey, board: Chessboard) -> Floats | None:
    """Inner corners (n, 2) [px] in the order of `board.corners()`, None if not all are seen."""
    pattern = (board.columns, board.rows)
    found, corners = cv2.findChessboardCornersSB(view, pattern, flags=cv2.CALIB_CB_ACCURACY)
    if not found:
        return None
    corners = corners.reshape(board.rows, board.columns, 2)
    # A chessboard looks the same after a half-turn, and OpenCV may start at either end: the
    # rig's board has its first row at the top of the image and its first column at the left.
    if corners[0, 0, 0] > corners[0, -1, 0]:
        corners = corners[:, ::-1]
    if corners[0, 0, 1] > corners[-1, 0, 1]:
        corners = corners[::-1]
    return _refined(view, np.ascontiguousarray(corners, dtype=np.float32))


def _refined(view: Grey, corners: Floats) -> Floats:
    """Corners (rows, columns, 2) [px] moved to the saddle points, as (n, 2).

    The detector's own corners are off by a common 0.01 px. Saddle points of the raw image follow
    the pixel grid by 0.06 px, because its edges are sharper than the interpolation between
    pixels; blurred by BLUR_PX first, they lie within 0.02 px, without a common shift.
    """
    spacing = float(np.linalg.norm(np.diff(corners, axis=1), axis=2).min())
    reach = max(int(spacing / 4), 2)
    blurred = cv2.GaussianBlur(view.astype(np.float32), (0, 0), BLUR_PX)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-6)
    start = corners.reshape(-1, 1, 2).copy()
    moved = cv2.cornerSubPix(blurred, start, (reach, reach), (-1, -1), criteria)
    return np.asarray(moved.reshape(-1, 2))
