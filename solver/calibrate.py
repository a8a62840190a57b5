"""Board views -> camera: intrinsics, and the pose of the calibration plane C.

View 0 shows the board lying in plane C at the pose that the rig states. A pinhole is found as
Zhang (2000) does, with OpenCV: the other views tilt the board, which is what makes the focal
length observable. A telecentric camera has no focal length and is found from view 0 alone.
"""

import math
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

    Raises InputError if the views differ in size, view 0 does not show the whole board, or, for
    a pinhole, fewer than three views do.
    """
    sizes = {view.shape for view in board_views}
    if len(sizes) != 1:
        raise InputError(f"the calibration views differ in size: {sorted(sizes)}, allowed is one")
    height, width = board_views[0].shape
    lying = _corners(board_views[0], rig.board)
    if lying is None:
        raise InputError("calibration view 0, which defines plane C, does not show the whole board")
    if rig.telecentric:
        return _telecentric(lying, width, height, rig)
    tilted = [_corners(view, rig.board) for view in board_views[1:]]
    return _pinhole([lying, *(seen for seen in tilted if seen is not None)], width, height, rig)


def _pinhole(corners: Sequence[Floats], width: int, height: int, rig: Rig) -> Calibration:
    """Camera from the corners (n, 2) [px] of several views, that of view 0 first."""
    if len(corners) < 3:
        raise InputError(f"{len(corners)} calibration views show the whole board, needed are 3")
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


def _telecentric(corners: Floats, width: int, height: int, rig: Rig) -> Calibration:
    """Camera from the corners (n, 2) [px] of the board lying in plane C.

    The least-squares affine map from board to pixels has six numbers, just those of a scaled
    orthographic view with square pixels: magnification, rotation and a shift in the image.
    A tilted plane looks shortened, whichever way it is tilted: of the two cameras that see the
    same we take the one that leans over the image's lower edge, so that what rises off the
    plane moves up in the image. Nor does one see how far off the camera is, or where its axis
    meets the image: it stands off by the width of its field, and its axis meets the middle.
    None of these three choices matters for points on C.
    """
    board = rig.board.corners()
    design = np.column_stack([board[:, :2], np.ones(len(board))])
    solution = np.linalg.lstsq(design, corners.astype(np.float64), rcond=None)[0]
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
    error = corners - design @ solution
    return Calibration(camera, float(np.sqrt((error**2).sum(axis=1).mean())))


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
