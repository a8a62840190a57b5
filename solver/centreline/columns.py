"""Gray values of one pixel column or row, and the interpolated profile at its pixels."""

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
    row = climb * (table.shape[0] - 1)
    low = min(int(row), table.shape[0] - 2)
    row_fraction, last = row - low, table.shape[1] - 1
    # A pixel is a whole number of table steps: all have the same fraction between entries.
    t = sense * offset / STEP + table.shape[1] // 2
    j = int(np.floor(t))
    fraction = t - j
    stride = int(sense / STEP)
    flatter, steeper = table[low], table[low + 1]
    for k in range(len(out)):
        out[k] = 0.0
        if 0 <= j < last:
            out[k] = (1 - row_fraction) * ((1 - fraction) * flatter[j] + fraction * flatter[j + 1])
            out[k] += row_fraction * ((1 - fraction) * steeper[j] + fraction * steeper[j + 1])
        j += stride
