"""Gray values of one pixel column or row, and the interpolated profile at its pixels."""

from typing import Any

import numpy as np

from solver.centreline.profile import STEP
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit


@njit
def read_column(image: Grey, line: int, upright: bool, first: int, gray: Floats) -> bool:
    """Fill `gray` from pixel `first` of a column (a row); return False where the image ends."""
    height, width = image.shape
    limit, n_lines = (height, width) if upright else (width, height)
    if first < 0 or first + len(gray) > limit or line < 0 or line >= n_lines:
        return False
    for k in range(len(gray)):
        gray[k] = image[first + k, line] if upright else image[line, first + k]
    return True


@njit
def interpolate_profile(
    table: Floats, climb: float, sense: float, offset: float, out: Floats
) -> None:
    """Interpolate the table at a climb and at pixels offset, offset + 1, ... from the centre."""
    row, column, stride, row_fraction, fraction = table_position(table, climb, sense, offset)
    for k in range(len(out)):
        out[k] = table_value(table, row, column + k * stride, row_fraction, fraction)


@njit(inline="always")
def table_position(table: Floats, climb: float, sense: float, offset: float) -> Any:
    """Locate a pixel at `offset` from the centre: row and column of the entry before it.

    Also return the number of columns to the next pixel and the fractions of a row and of a column
    from the entry to the pixel. A pixel is a whole number of columns: all pixels have the same.
    """
    row = climb * (table.shape[0] - 1)
    low = min(int(row), table.shape[0] - 2)
    column = sense * offset / STEP + table.shape[1] // 2
    first = int(np.floor(column))
    return low, first, int(sense / STEP), row - low, column - first


@njit(inline="always")
def table_value(
    table: Floats, row: int, column: int, row_fraction: float, fraction: float
) -> float:
    """Interpolate the table between an entry and the next of both directions; 0 outside."""
    if not 0 <= column < table.shape[1] - 1:
        return 0.0
    flatter = (1 - fraction) * table[row, column] + fraction * table[row, column + 1]
    steeper = (1 - fraction) * table[row + 1, column] + fraction * table[row + 1, column + 1]
    return float((1 - row_fraction) * flatter + row_fraction * steeper)
