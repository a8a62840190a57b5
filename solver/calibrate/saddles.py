"""Detection of chequered targets: corners by OpenCV, refined to the saddle points."""

from typing import Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.board import Charuco, Chessboard
from solver.instrument.errors import InputError
from solver.instrument.images import eight_bit

BLUR_PX: Final = 1.5
# Search distance for the saddle, over the distance between corners: a marker's rim is two tenths
# away, and the edges of the next corner begin at half. Measured on 40 rigs drawn at random: from
# 0.25 to 0.45, the median reprojection error fell from 0.066 to 0.031 px, beyond it no further.
_SEARCH, _SEARCH_BETWEEN_MARKERS = 0.45, 0.2
# Distance, in squares, within which a marker is in its place on the board, and the least number of
# markers by which a board of another size is recognised. Chosen: wrong places are whole squares
# off, and a pattern in the picture may be taken for a marker.
_IN_PLACE, _MIN_MARKERS = 0.25, 6
# Least share of the markers in place. Chosen: on a board of another size, up to two thirds of them
# can be in place, sheared.
_SHARE_IN_PLACE: Final = 0.9
# Numbers of columns of squares that are tried.
_COLUMNS: Final = range(3, 41)


def chessboard(view: Grey, board: Chessboard) -> BoardDetection | None:
    """Detect inner corners in a view (height, width); return None if not all are visible.

    Where they are not in the gray values, they may be in the logarithm: light that falls off across
    the board scales the contrast of its squares, but not the difference of their logarithms.
    """
    pattern = (board.columns, board.rows)
    for image in (eight_bit(view), _logarithm(eight_bit(view))):
        success, corners = cv2.findChessboardCornersSB(image, pattern, flags=cv2.CALIB_CB_ACCURACY)
        if success:
            break
    else:
        return None
    corners = np.asarray(corners, np.float64).reshape(board.rows, board.columns, 2)
    corners = _upright(eight_bit(view), corners)
    numbers = np.arange(board.rows * board.columns)
    return _refine(view, BoardDetection(numbers, corners.reshape(-1, 2)), board, _SEARCH)


def other_chessboard(view: Grey, board: Chessboard) -> str:
    """Say how many corners the chessboard in a view has, if not as many as `board`; "" if none."""
    found, _, colours = cv2.findChessboardCornersSBWithMeta(
        eight_bit(view), (3, 3), cv2.CALIB_CB_LARGER
    )
    if not found or set(colours.shape) == {board.columns, board.rows}:
        return ""
    rows, columns = sorted(colours.shape)
    return (
        f"a board of {columns} x {rows} inner corners, and board.columns and board.rows of "
        f"rig.json are {board.columns} and {board.rows}; inner corners are one fewer than squares"
    )


def _logarithm(image: Grey) -> Grey:
    """Compute log(1 + gray), scaled to 8 bits, of an image (height, width) of 8 bits."""
    return np.asarray(np.rint(np.log1p(image) * (255 / np.log(256))), np.uint8)


def _upright(view: Grey, corners: Floats) -> Floats:
    """Order corners (rows, columns, 2) as on the board: from its upper left, row by row.

    OpenCV may start at any end. A board is seen from its front, so that from its columns' direction
    to its rows' is a quarter turn clockwise; of the two orders that remain, the colours show the
    right one, if one of the numbers of rows and columns is even and the other odd. Otherwise both
    look the same, and the camera's roll is taken for less than a quarter turn.
    """
    right, down = corners[0, -1] - corners[0, 0], corners[-1, 0] - corners[0, 0]
    if right[0] * down[1] < right[1] * down[0]:
        corners = corners[:, ::-1]
    rows, columns = corners.shape[:2]
    if (rows + columns) % 2 == 0:
        turned = (corners[0, -1] - corners[0, 0])[0] < 0
    else:
        middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2
        u, v = np.rint(middles).astype(np.int64).transpose(2, 0, 1)
        # The square at the upper left corner's lower right is black, as that at its upper left.
        colour = view[v, u].astype(np.float64)
        black = np.add.outer(np.arange(rows - 1), np.arange(columns - 1)) % 2 == 0
        turned = colour[black].mean() > colour[~black].mean()
    return corners[::-1, ::-1] if turned else corners


def charuco(view: Grey, board: Charuco) -> BoardDetection | None:
    """Detect corners beside readable markers; return None if there are none.

    OpenCV before 4.6 printed boards with an even number of rows of squares in other colours: the
    upper left square was white. They are tried where the board of today is not found. Raises
    InputError if the markers are mirrored, or are those of a board of another size.
    """
    # At twice the size, marker bits of two pixels are readable.
    enlarged = np.asarray(
        cv2.resize(eight_bit(view), None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8
    )
    detection, markers = _marked_corners(enlarged, board)
    other = _other_charuco(markers, board, detection is not None)
    if other:
        raise InputError(f"a calibration view shows {other}")
    if detection is None:
        mirrored, _ = _marked_corners(np.ascontiguousarray(enlarged[:, ::-1]), board)
        if mirrored is not None and len(mirrored) >= THRESHOLDS.min_target_points:
            raise InputError(
                "the images are mirrored: the board's markers can be read only in their mirror "
                "image; switch the mirroring off in the camera, and take all images again"
            )
        return None
    return _refine(view, detection, board, _SEARCH_BETWEEN_MARKERS)


class _Markers(NamedTuple):
    """Markers in a view: `numbers` (n,), and their `centres` (n, 2) [px]."""

    numbers: npt.NDArray[np.int64]
    centres: Floats


def _marked_corners(enlarged: Grey, board: Charuco) -> tuple[BoardDetection | None, _Markers]:
    """Detect a board, of either layout, in a view of twice the size (height, width)."""
    dictionary = cv2.aruco.getPredefinedDictionary(
        getattr(cv2.aruco, f"DICT_{board.dictionary.upper()}")
    )
    size = (board.columns + 1, board.rows + 1)
    markers = _Markers(np.zeros(0, np.int64), np.zeros((0, 2)))
    for legacy in (False, True):
        aruco_board = cv2.aruco.CharucoBoard(size, 1.0, 0.6, dictionary)
        aruco_board.setLegacyPattern(legacy)
        corners, numbers, outlines, marker_numbers = cv2.aruco.CharucoDetector(
            aruco_board
        ).detectBoard(enlarged)
        if marker_numbers is not None and len(marker_numbers) > 0:
            centres = np.reshape(outlines, (-1, 4, 2)).mean(axis=1).astype(np.float64)
            markers = _Markers(marker_numbers.ravel().astype(np.int64), centres)
        if numbers is not None and len(numbers) > 0:
            order = np.argsort(numbers.ravel())
            pixels = (corners.reshape(-1, 2)[order] - 0.5) / 2
            return BoardDetection(numbers.ravel()[order].astype(np.int64), pixels), markers
    return None, markers


def _other_charuco(markers: _Markers, board: Charuco, seen: bool) -> str:
    """Say how many corners the board with these markers has, if not as many as `board`; or "".

    `seen`: corners of `board` were detected.
    """
    if len(markers.numbers) < _MIN_MARKERS:
        return ""
    columns = board.columns + 1
    rows = _rows_in_place(markers, columns)
    if len(rows) < _SHARE_IN_PLACE * len(markers.numbers):
        columns = max((columns, *_COLUMNS), key=lambda count: len(_rows_in_place(markers, count)))
        rows = _rows_in_place(markers, columns)
        if len(rows) < _SHARE_IN_PLACE * len(markers.numbers):
            return ""
    if len(np.unique(rows)) < 3:  # markers in a line, or in two, fit other boards as well
        return ""
    # One marker below the last row may be a pattern in the picture.
    too_many = np.sort(rows)[-2] > board.rows
    too_few = not seen and rows.max() < board.rows
    if columns == board.columns + 1 and not too_many and not too_few:
        return ""
    return (
        f"markers of a board of {columns - 1} x {rows.max()} inner corners or more rows, and "
        f"board.columns and board.rows of rig.json are {board.columns} and {board.rows}; inner "
        "corners are one fewer than squares"
    )


def _rows_in_place(markers: _Markers, columns: int) -> npt.NDArray[np.int64]:
    """Return the rows of those markers that are in place on a board with `columns` of squares.

    White squares have the markers. `first` is the number of black squares before the first white
    one: one, or none on some boards of before OpenCV 4.6.
    """
    found = np.zeros(0, np.int64)
    for first in (1, 0):
        row, column = np.divmod(2 * markers.numbers + first, columns)
        if columns % 2 == 0:
            column[row % 2 == 1] += 1 - 2 * first
        places = np.column_stack([column, row]).astype(np.float64)
        _, valid = cv2.findHomography(markers.centres, places, cv2.RANSAC, _IN_PLACE)
        if valid is not None and np.count_nonzero(valid) > len(found):
            found = row[valid.ravel() == 1]
    return found


def _refine(
    view: Grey, detection: BoardDetection, board: Chessboard | Charuco, search: float
) -> BoardDetection | None:
    """Refine corners to the saddle points; remove those that move too far or out of view.

    The detector's own corners have a common error of 0.01 px, those between markers a larger one
    where the lens bends lines (OpenCV's issue 23873). Saddle points of the raw image follow the
    pixel grid by 0.06 px, because its edges are sharper than the interpolation between pixels;
    blurred by BLUR_PX and at twice the resolution, their errors are within 0.01 px, without a
    common shift.
    """
    spacing = _spacing(detection, board)
    if not np.isfinite(spacing):
        return None
    window = max(int(search * spacing), 2)
    blurred = cv2.GaussianBlur(view.astype(np.float32), (0, 0), BLUR_PX)
    fine = cv2.resize(blurred, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-6)
    start = (2 * detection.pixels + 0.5).astype(np.float32).reshape(-1, 1, 2)
    refined = cv2.cornerSubPix(fine, start, (2 * window, 2 * window), (-1, -1), criteria)
    pixels = (refined.reshape(-1, 2).astype(np.float64) - 0.5) / 2
    height, width = view.shape
    margin = window + BLUR_PX
    inside = ((pixels > margin) & (pixels < [width - 1 - margin, height - 1 - margin])).all(axis=1)
    valid = inside & (np.linalg.norm(pixels - detection.pixels, axis=1) < window)
    return BoardDetection(detection.numbers[valid], pixels[valid]) if valid.any() else None


def _spacing(detection: BoardDetection, board: Chessboard | Charuco) -> float:
    """Compute the least distance [px] of neighbours in a row or column; infinite without any."""
    pixels = np.full((board.rows * board.columns, 2), np.nan)
    pixels[detection.numbers] = detection.pixels
    grid = pixels.reshape(board.rows, board.columns, 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).ravel() for axis in (0, 1)]
    distances = np.concatenate(steps)
    return float(np.min(distances, initial=np.inf, where=~np.isnan(distances)))
