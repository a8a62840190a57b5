"""Plot of the relative errors of contact distance and force, with their ellipses."""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.viewer.ellipses import RADIUS, ellipse

# Divisions from the middle of the plot to its rim.
HALF: Final = 5
# Divisions over which the typical ellipse extends from its middle. Chosen: a rim for other ones.
_TYPICAL: Final = 2.0
_SIGMAS: Final = ("x_c_sigma_mm", "force_sigma_n")


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
