"""Squares: the calibration board, a chessboard printed on white card, and a patterned ground."""

import numpy as np
import trimesh

from solver.instrument.rig import Chessboard


def board(chessboard: Chessboard) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """(white, black) cells of the board in its own frame (z = 0, facing +z), edge to edge.

    One cell more than inner corners each way, and a white margin of one cell around.
    """
    columns, rows, square = chessboard.columns + 3, chessboard.rows + 3, chessboard.square
    row, column = np.mgrid[0:rows, 0:columns]
    inside = (row > 0) & (row < rows - 1) & (column > 0) & (column < columns - 1)
    black = inside & ((row + column) % 2 == 0)
    vertices = _grid(columns, rows, square)
    return _cells(vertices, ~black), _cells(vertices, black)


def squares(side: float, square: float) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """(light, dark) cells [m] of a chequered sheet about the origin, facing +z, edge to edge."""
    count = max(round(side / square), 2)
    row, column = np.mgrid[0:count, 0:count]
    dark = (row + column) % 2 == 0
    vertices = _grid(count, count, square)
    return _cells(vertices, ~dark), _cells(vertices, dark)


def _grid(columns: int, rows: int, square: float) -> np.ndarray:
    """Corners of all cells, row by row from the top."""
    y, x = np.mgrid[0 : rows + 1, 0 : columns + 1].astype(float)
    return np.column_stack(
        [(x.ravel() - columns / 2) * square, (rows / 2 - y.ravel()) * square, np.zeros(x.size)]
    )


def _cells(vertices: np.ndarray, chosen: np.ndarray) -> trimesh.Trimesh:
    row, column = np.nonzero(chosen)
    stride = chosen.shape[1] + 1
    a = row * stride + column
    b, c, d = a + 1, a + stride + 1, a + stride
    faces = np.vstack([np.column_stack([a, c, b]), np.column_stack([a, d, c])])
    return trimesh.Trimesh(vertices, faces, process=False)
