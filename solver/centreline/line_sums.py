"""Mean gray values along lines from the clamp, that may be slightly bowed."""

from typing import NamedTuple

import cv2
import numpy as np

from solver.centreline.guide import LINES, Guide
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats

# Part of the beam's length that is summed: its clamp and its end are left out.
FIRST, LAST = 0.05, 0.97
# Lines elsewhere are within this distance [px] beside the beam. Chosen: a hundred lines, under
# light that is still like that at the beam.
BESIDE_PX = 60.0


class Line(NamedTuple):
    """A line: distances [px] from the nominal beam, as in `line_at`, and `offset` at its clamp.

    The beam along it has a `polarity`, and a `width` over the rig's diameter.
    """

    tip: float
    bow: float
    offset: float
    polarity: int
    width: int


class Sheet(NamedTuple):
    """The image along the beam: gray values (n, m), n offsets [px] across, and m positions.

    `x` (m,) is over the beam's length. Values beside the image are NaN. The whole beam has LINES
    positions.
    """

    gray: Floats
    offset: Floats
    x: Floats

    def parts(self, count: int) -> "list[Sheet]":
        """Divide the sheet along the beam into a number of parts."""
        pieces = np.array_split(np.arange(len(self.x)), count)
        return [Sheet(self.gray[:, k], self.offset, self.x[k]) for k in pieces]


def straightened(image: Floats, guide: Guide, beside: float) -> Sheet:
    """Sample the image each pixel across the nominal beam, and average along it over each line."""
    half = round(max(BESIDE_PX, beside))
    offset = np.arange(-half, half + 1, dtype=np.float64)
    per_line = max(round((LAST - FIRST) * guide.length / guide.pixel / LINES), 1)
    x = np.linspace(FIRST, LAST, LINES * per_line)
    along, across = np.meshgrid(guide.length * x, guide.pixel * offset)
    pixels = guide.pixels(np.column_stack([along.ravel(), across.ravel()])).astype(np.float32)
    u, v = pixels[:, 0].reshape(along.shape), pixels[:, 1].reshape(along.shape)
    gray = cv2.remap(
        image.astype(np.float32), u, v, cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=(np.nan,),
    )  # fmt: skip
    return Sheet(
        gray.reshape(len(offset), LINES, per_line).mean(axis=2, dtype=np.float64),
        offset,
        x.reshape(LINES, per_line).mean(axis=1),
    )


def line_at(x: Floats, tip: float, bow: float) -> Floats:
    """Compute the distance [px] of a bowed line from the nominal beam, at x over the length."""
    return np.asarray(tip * x + bow * 4 * x * (1 - x))


def line_sums(
    sheet: Sheet, tips: Floats, bows: Floats, support: float = THRESHOLDS.min_support_at_rest
) -> Floats:
    """Average the sheet along each line (tip, bow, offset).

    NaN where less than the share `support` of the line is in the image.
    """
    n, n_lines = sheet.gray.shape
    known = np.isfinite(sheet.gray)
    # Rows beyond the sheet are unknown.
    gray = np.vstack([np.where(known, sheet.gray, 0.0), np.zeros((1, n_lines))])
    known = np.vstack([known, np.zeros((1, n_lines), bool)])
    result = np.empty((len(tips), len(bows), n))
    for i, tip in enumerate(tips):
        for j, bow in enumerate(bows):
            shift = np.rint(line_at(sheet.x, tip, bow)).astype(np.int64)
            row = np.arange(n)[:, None] + shift
            place = np.where((row >= 0) & (row < n), row, n) * n_lines + np.arange(n_lines)
            count = known.take(place).sum(axis=1)
            total = gray.take(place).sum(axis=1)
            enough = count >= support * n_lines
            result[i, j] = np.where(enough, total / np.maximum(count, 1), np.nan)
    return result
