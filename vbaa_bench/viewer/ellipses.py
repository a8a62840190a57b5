"""Ellipses that contain 95 % of the errors: in the plot of x_c and force, and at contact points."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.viewer.frames import ViewedFrame

# The 95 % quantile of chi-squared with two degrees of freedom is -2 ln(1 - 0.95).
RADIUS: Final = math.sqrt(-2 * math.log(0.05))
_POINTS: Final = 96
# Divisions from the middle of the plot to its rim.
HALF: Final = 5
# Divisions over which the typical ellipse extends from its middle. Chosen: a rim for other ones.
_TYPICAL: Final = 2.0
_SIGMAS: Final = ("x_c_sigma_mm", "force_sigma_n")
# Axes of the plot and their ticks, lines in divisions.
AXES: Final = [[(-HALF, 0.0), (HALF, 0.0)], [(0.0, -HALF), (0.0, HALF)]]
TICKS: Final = [
    *([(tick, -0.1), (tick, 0.1)] for tick in range(-HALF, HALF + 1)),
    *([(-0.1, tick), (0.1, tick)] for tick in range(-HALF, HALF + 1)),
]


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


class EstimatedContact(NamedTuple):
    """Contact point (3,) and its 95 % ellipse (n, 3) in plane D, in the camera's frame [m].

    The ellipse is None if a sigma or the correlation of x_c and y_c is not stated.
    """

    point: Floats
    ellipse: Floats | None


def estimated_contact(frame: ViewedFrame, method: str) -> EstimatedContact | None:
    """Place a method's contact point in the frame in which the camera is fixed.

    Return None if x_c or y_c is not estimated. A method that does not estimate psi assumes 0.
    """
    row = frame.estimates.get(method)
    if row is None or row["x_c_mm"] is None or row["y_c_mm"] is None:
        return None
    psi = (row["psi_deg"] or 0.0) * DEGREE
    in_plane = np.array([row["x_c_mm"], row["y_c_mm"]])

    def in_space(points: Floats) -> Floats:
        x, y = points.T * MILLIMETRE
        in_clamp = np.column_stack([x, y * np.cos(psi), y * np.sin(psi)])
        return apply(frame.frame_from_clamp, in_clamp)

    (point,) = in_space(in_plane[None])
    sigmas, correlation = (row["x_c_sigma_mm"], row["y_c_sigma_mm"]), row["x_c_y_c_correlation"]
    if None in sigmas or correlation is None or abs(correlation) > 1:
        return EstimatedContact(point, None)
    return EstimatedContact(point, in_space(in_plane + ellipse(sigmas, correlation)))
