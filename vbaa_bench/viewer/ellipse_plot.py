"""Plot of the errors of contact distance and force, with the ellipses that contain 95 % of them."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.report.gallery import Colours
from vbaa_bench.viewer.frames import ViewedFrame
from vbaa_bench.viewer.text import FAINT, PAPER, Colour, write, write_right

# The 95 % quantile of chi-squared with two degrees of freedom is -2 ln(1 - 0.95).
RADIUS: Final = math.sqrt(-2 * math.log(0.05))
_POINTS: Final = 96
# Divisions from the middle of the plot to its rim.
HALF: Final = 5
# Divisions over which the typical ellipse extends from its middle. Chosen: a rim for other ones.
_TYPICAL: Final = 2.0
_SIGMAS: Final = ("x_c_sigma_mm", "force_sigma_n")
# The rim of the panel, in divisions beyond the ends of the axes.
_RIM: Final = 0.3
_BITS: Final = 4  # of a fraction of a pixel


class PlottedError(NamedTuple):
    """Error (2,) of an estimate in divisions, right and down, and the 95 % ellipse (n, 2) about it.

    The ellipse is None if a sigma or the correlation is not stated.
    """

    point: Floats
    ellipse: Floats | None


class EllipsePlot(NamedTuple):
    """Plot with the error of x_c to the right and of the force, over its true value, upwards.

    A division is `x_c_mm` to the right and `force_pct` upwards.
    """

    x_c_mm: float
    force_pct: float

    def place(self, row: Mapping[str, Any], truth: Mapping[str, Any]) -> PlottedError | None:
        """Place an estimate, a row of predictions, beside its truth; None if it lacks a value."""
        values = row["x_c_mm"], row["force_n"], truth["x_c_mm"], truth["force_n"]
        if any(value is None for value in values):
            return None
        x_c, force, true_x_c, true_force = values
        division = np.array([self.x_c_mm, -self.force_pct / 100 * true_force])
        point = np.array([x_c - true_x_c, force - true_force]) / division
        sigmas = [row[name] for name in _SIGMAS]
        correlation = row["x_c_force_correlation"]
        if None in sigmas or correlation is None or abs(correlation) > 1:
            return PlottedError(point, None)
        return PlottedError(point, point + ellipse(sigmas, correlation) / division)


def ellipse(sigmas: Sequence[float], correlation: float) -> Floats:
    """Compute a closed line (n, 2) about the origin, of errors with these sigmas."""
    angle = np.linspace(0, 2 * np.pi, _POINTS + 1)
    first, second = np.cos(angle), np.sin(angle)
    other = correlation * first + math.sqrt(1 - correlation**2) * second
    return np.asarray(RADIUS * np.column_stack([sigmas[0] * first, sigmas[1] * other]))


def ellipse_plot(predictions: Mapping[str, pl.DataFrame]) -> EllipsePlot:
    """Choose the scales of the plot, for tables of predictions by method.

    The ellipses of the method with the smallest median sigma of x_c fill it; those of methods
    without sigmas are not considered.
    """
    sigmas = pl.col("x_c_sigma_mm"), 100 * pl.col("force_sigma_n") / pl.col("force_n").abs()
    medians = [table.select(*sigmas).median().row(0) for table in predictions.values()]
    stated = [pair for pair in medians if all(value and math.isfinite(value) for value in pair)]
    x_c_mm, force_pct = min(stated, default=(1.0, 1.0))
    scale = RADIUS / _TYPICAL
    return EllipsePlot(_rounded(scale * x_c_mm), _rounded(scale * force_pct))


def _rounded(value: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(step for step in (1, 2, 5, 10) if step * power >= 0.999 * value) * power)


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
