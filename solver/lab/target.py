"""Printable calibration target: an SVG in true size."""

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.board import Board, Charuco, LineNetwork
from solver.instrument.units import MILLIMETRE

_BITS = 10  # per side of a square, as in Charuco
_STRIP_MM = 12.0  # below the card, for the bar used to check the print's scale
_BAR_MM = 100.0


def svg(board: Board) -> str:
    """Draw the target as SVG, in millimetres: black on a white card, with a bar of 100 mm below it.

    The card ends two squares beyond the outermost points, so a margin of one square stays white.
    The bar may be cut off.
    """
    width, height = (
        (count + 3) * board.square / MILLIMETRE for count in (board.columns, board.rows)
    )
    bar = min(_BAR_MM, 10 * (width // 10))
    y = height + _STRIP_MM - 3
    shapes = "".join(
        f'<rect x="{x:.4f}" y="{top:.4f}" width="{w:.4f}" height="{h:.4f}"/>\n'
        for x, top, w, h in black_rectangles(board) / MILLIMETRE
    )
    total = height + _STRIP_MM
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.4f}mm" height="{total:.4f}mm" '
        f'viewBox="0 0 {width:.4f} {total:.4f}" shape-rendering="crispEdges">\n'
        f'<rect width="{width:.4f}" height="{total:.4f}" fill="white"/>\n'
        f"{shapes}"
        f'<path d="M 1 {y - 2} v 4 m 0 -2 h {bar} m 0 -2 v 4" fill="none" stroke="black" '
        f'stroke-width="0.2"/>\n'
        f'<text x="2" y="{y - 1}" font-size="4" font-family="sans-serif">'
        f"{bar:g} mm: measure it, then cut this strip off</text>\n"
        "</svg>\n"
    )


def black_rectangles(board: Board) -> Floats:
    """List the black rectangles (n, 4): x, y, width, height [m] from the card's upper left."""
    if isinstance(board, LineNetwork):
        return _lines(board)
    if isinstance(board, Charuco):
        return _runs(_charuco(board), board.square / _BITS, board.square)
    row, column = np.mgrid[0 : board.rows + 1, 0 : board.columns + 1]
    return _runs((row + column) % 2 == 0, board.square, board.square)


def _lines(board: LineNetwork) -> Floats:
    column = np.arange(board.columns)
    row = np.arange(board.rows)
    column_widths = np.where(column == board.thick_column, 2.0, 1.0) * board.line_width
    row_widths = np.where(row == board.thick_row, 2.0, 1.0) * board.line_width
    square = board.square
    # The outermost crossings are two squares inside the card, the ends of lines one and a half.
    vertical = np.column_stack(
        [
            (column + 2) * square - column_widths / 2,
            np.full(board.columns, 1.5 * square),
            column_widths,
            np.full(board.columns, board.rows * square),
        ]
    )
    horizontal = np.column_stack(
        [
            np.full(board.rows, 1.5 * square),
            (row + 2) * square - row_widths / 2,
            np.full(board.rows, board.columns * square),
            row_widths,
        ]
    )
    return np.vstack([vertical, horizontal])


def _charuco(board: Charuco) -> Mask:
    """Draw the board with OpenCV; return a mask of black cells, one per bit of a marker."""
    name = f"DICT_{board.dictionary.upper()}"
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    size = (board.columns + 1, board.rows + 1)
    aruco_board = cv2.aruco.CharucoBoard(size, 1.0, 0.6, dictionary)
    return np.asarray(aruco_board.generateImage((size[0] * _BITS, size[1] * _BITS)) == 0)


def _runs(black: Mask, cell: float, margin: float) -> Floats:
    """Merge black cells along each row to rectangles (n, 4)."""
    edges = np.diff(np.pad(black, ((0, 0), (1, 1))).astype(int), axis=1)
    row, start = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    runs = np.column_stack([start, row, end - start, np.ones_like(row)]) * cell
    runs[:, :2] += margin
    return runs
