"""Drawing of the plot of errors: points and ellipses of all methods in one frame."""

from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.report.gallery import Colours
from vbaa_bench.viewer.ellipse_plot import HALF, EllipsePlot
from vbaa_bench.viewer.frames import ViewedFrame
from vbaa_bench.viewer.text import FAINT, PAPER, Colour, write, write_right

# The rim of the panel, in divisions beyond the ends of the axes.
_RIM: Final = 0.3
_BITS: Final = 4  # of a fraction of a pixel


def error_panel(
    frame: ViewedFrame, colours: Colours, plot: EllipsePlot, side_px: int
) -> np.ndarray:
    """Draw the errors of x_c and force in a square (side_px, side_px, 3), BGR.

    An estimate beyond the rim is not drawn, but its ellipse may reach into the panel.
    """
    panel = np.full((side_px, side_px, 3), PAPER, np.uint8)
    for tick in range(-HALF, HALF + 1):
        _line(panel, np.array([(tick, -0.1), (tick, 0.1)]), FAINT)
        _line(panel, np.array([(-0.1, tick), (0.1, tick)]), FAINT)
    _line(panel, np.array([(-HALF, 0.0), (HALF, 0.0)]), FAINT)
    _line(panel, np.array([(0.0, -HALF), (0.0, HALF)]), FAINT)
    for method, colour in colours.items():
        row = frame.estimates.get(method)
        placed = None if row is None else plot.place(row, frame.row)
        if placed is None:
            continue
        if placed.ellipse is not None:
            _line(panel, placed.ellipse, colour)
        if np.abs(placed.point).max() <= HALF + _RIM:
            ((u, v),) = _place(placed.point[None], side_px)
            cv2.circle(panel, (int(u), int(v)), 4 << _BITS, colour, -1, cv2.LINE_AA, _BITS)
    middle = side_px // 2
    write(panel, f"force +{HALF * plot.force_pct:g} %", (middle + 10, 20), FAINT, 14)
    write_right(panel, f"x_c +{HALF * plot.x_c_mm:g} mm", (side_px - 4, middle + 26), FAINT, 14)
    return panel


def _line(panel: np.ndarray, points: Floats, colour: Colour) -> None:
    path = [_place(points, panel.shape[0])]
    cv2.polylines(panel, path, False, colour, 1, cv2.LINE_AA, _BITS)


def _place(points: Floats, side_px: int) -> np.ndarray:
    """Convert divisions (n, 2), right and down, to fractions of pixels; far ones are cut off."""
    scale = side_px / (2 * (HALF + _RIM))
    # OpenCV's fractions of pixels overflow beyond 2^27.
    pixels = np.clip(side_px / 2 + scale * np.asarray(points), -1e5, 1e5)
    return np.asarray(np.rint(pixels * 2**_BITS), np.int32)
