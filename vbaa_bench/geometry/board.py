"""Calibration targets as cells that are printed black or white, and their meshes."""

from typing import NamedTuple

import cv2
import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.board import Board, Charuco, LineNetwork
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.sheets import even_edges, printed

# Bits along a side of a chequered square, and along a side of the marker at its centre.
_BITS, _MARKER = 10, 6


class Cells(NamedTuple):
    """Printed cells: increasing edges [m] in x and y, and which are black (rows, columns).

    Rows are counted from the top, the largest y.
    """

    x: Floats
    y: Floats
    black: np.ndarray


def cells(target: Board) -> Cells:
    """Compute the cells of a target in its own frame.

    The card ends two squares beyond the outermost points; the outer square is a white margin.
    """
    if isinstance(target, LineNetwork):
        return _lines(target)
    if isinstance(target, Charuco):
        return _charuco(target)
    x, y = even_edges(target.columns + 3, target.square), even_edges(target.rows + 3, target.square)
    return Cells(x, y, np.pad(_chequered(target), 1))


def board(target: Board) -> tuple[Mesh, Mesh]:
    """Mesh the (white, black) cells of a target in its own frame, facing +z, edge to edge."""
    return printed(*cells(target))


def _chequered(target: Board) -> np.ndarray:
    """Return the mask of black squares, with one square more each way than inner corners."""
    row, column = np.mgrid[0 : target.rows + 1, 0 : target.columns + 1]
    return np.asarray((row + column) % 2 == 0)


def _charuco(target: Charuco) -> Cells:
    """Compute cells of one marker bit each."""
    chequered = _chequered(target)
    name = f"DICT_{target.dictionary.upper()}"
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    black = np.kron(chequered, np.ones((_BITS, _BITS), bool))
    margin = (_BITS - _MARKER) // 2
    for number, (row, column) in enumerate(np.argwhere(~chequered) * _BITS + margin):
        bits = cv2.aruco.generateImageMarker(dictionary, number, _MARKER)
        black[row : row + _MARKER, column : column + _MARKER] = bits == 0
    bit = target.square / _BITS
    x, y = even_edges((target.columns + 3) * _BITS, bit), even_edges((target.rows + 3) * _BITS, bit)
    return Cells(x, y, np.pad(black, _BITS))


def _lines(target: LineNetwork) -> Cells:
    """Compute cells bounded by the lines' rims and ends."""
    x, across, within_x = _strokes(target, target.columns, target.thick_column)
    # Rows are counted downward, so y starts at the top.
    y, along, within_y = _strokes(target, target.rows, target.thick_row)
    black = (along[:, None] & within_x) | (within_y[:, None] & across)
    return Cells(x, -y[::-1], black)


def _strokes(target: LineNetwork, count: int, thick: int) -> tuple[Floats, np.ndarray, np.ndarray]:
    """Compute increasing edges along one axis, cells on a line, and cells between lines' ends."""
    width = np.full(count, target.line_width)
    width[thick] *= 2
    middle = (np.arange(count) - (count - 1) / 2) * target.square
    rims = np.column_stack([middle - width / 2, middle + width / 2]).ravel()
    end, card = count / 2 * target.square, (count + 3) / 2 * target.square
    edges = np.array([-card, -end, *rims, end, card])
    cells = np.arange(len(edges) - 1)
    inside = (cells > 0) & (cells < cells[-1])
    return edges, inside & (cells % 2 == 0), inside
