"""Board views -> camera: intrinsics, distortion, and the pose of the calibration plane C.

View 0 shows the board lying in plane C at the pose that the rig states. The other views tilt the
board, which is what makes a pinhole's focal length observable; with view 0 alone, plane C is
known and the viewpoint is not. A telecentric camera has no focal length and is found from view 0.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import cv2
import numpy as np

from solver.calibrate.calibration import Calibration as Calibration
from solver.calibrate.lines import line_network
from solver.calibrate.pinhole import pinhole
from solver.calibrate.plane_alone import plane_alone
from solver.calibrate.saddles import charuco, chessboard
from solver.calibrate.sighting import Sighting
from solver.calibrate.telecentric import telecentric
from solver.instrument.arrays import Grey
from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig

# Of a target that may be seen in part; they must not lie in fewer than three rows or columns.
LEAST_POINTS = 12


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
    """Camera from gray images (height, width) of the rig's board, of 8 or 16 bits.

    Raises InputError if the views differ in size, view 0 does not show the board (a chessboard as
    a whole, another target in good part), or, of several views of a pinhole, fewer than three do.
    """
    sizes = {view.shape for view in board_views}
    if len(sizes) != 1:
        raise InputError(f"the calibration views differ in size: {sorted(sizes)}, allowed is one")
    height, width = board_views[0].shape
    lying = sighting(board_views[0], rig.board)
    if lying is None:
        whole = "the whole board" if isinstance(rig.board, Chessboard) else "enough of the board"
        raise InputError(f"calibration view 0, which defines plane C, does not show {whole}")
    if rig.telecentric:
        return telecentric(lying, width, height, rig)
    if len(board_views) == 1 and not rig.distortion_coefficients:
        return plane_alone(lying, width, height, rig)
    tilted = [sighting(view, rig.board) for view in board_views[1:]]
    return pinhole([lying, *(seen for seen in tilted if seen is not None)], width, height, rig)


def sighting(view: Grey, board: Board) -> Sighting | None:
    """Points of the board in a view (height, width), None if too few are seen.

    They are detected in 8 bits and refined in all bits that the view has.
    """
    seen: Sighting | None = None
    if isinstance(board, Charuco):
        seen = charuco(view, board)
    elif isinstance(board, LineNetwork):
        seen = line_network(view, board)
    elif isinstance(board, Chessboard):
        seen = chessboard(view, board)
    if seen is None or len(seen) < min(LEAST_POINTS, board.columns * board.rows):
        return None
    row, column = np.divmod(seen.numbers, board.columns)
    return seen if min(len(np.unique(row)), len(np.unique(column))) >= 3 else None
