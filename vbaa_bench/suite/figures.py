"""Figures of the leaderboard: declared statistics of one dataset, and how tracks combine them."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.scoring.ranking import TIME_OVER_REFERENCE
from vbaa_bench.scoring.scored_quantities import X_C
from vbaa_bench.scoring.statistics import (
    FAILURE_ERROR_PCT_L,
    MEAN,
    MEDIAN,
    SUMMARY,
    TIMES,
    Statistic,
    error_statistics,
)

# Frames that have an error: contacts that are not rightly refused, and false contacts.
_DUE: Final = ~pl.col("rightly_refused") & (~pl.col("free") | pl.col("failed"))
# Smaller errors and ratios count as this one. Chosen: far below any, and has a logarithm.
_LEAST: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Figure:
    """Figure of the leaderboard.

    Of a track, it is the mean over its datasets of a `share`, and the geometric mean of others:
    each dataset counts alike, whatever its number of frames and the size of its errors.
    """

    heading: str
    statistic: Statistic
    share: bool = False

    def of_track(self, values: Floats) -> Floats:
        """Combine the values of datasets, (datasets, ...), to those of a track, (...)."""
        if self.share:
            return np.asarray(values.mean(axis=0))
        return np.asarray(np.exp(np.log(np.maximum(values, _LEAST)).mean(axis=0)))


def _share(heading: str, statistic: Statistic) -> Figure:
    return Figure(heading, replace(statistic, in_percent=True), share=True)


# The figure by which methods are ranked.
ERROR: Final = "error_pct_L"
# And by which times are.
TIME: Final = "time_over_reference"
FIGURES: Final = {
    ERROR: Figure(
        "error of x_c, % of L",
        Statistic(
            "median absolute error of x_c; a failure counts as an error of L/2",
            MEDIAN,
            pl.col("x_c_error_pct_L").abs().fill_null(FAILURE_ERROR_PCT_L),
            where=_DUE,
        ),
    ),
    "rmse_over_limit": Figure("RMSE over limit", error_statistics(X_C)["rmse_over_limit"]),
    "answered_pct": _share(
        "answered, %",
        Statistic(
            "share of the contacts with an estimate, of those that are not rightly refused",
            MEAN,
            ~pl.col("failed"),
            where=_DUE & ~pl.col("free"),
        ),
    ),
    "within_3_sigma_pct": _share("within 3 sigma, %", error_statistics(X_C)["within_3_sigma"]),
    "sigma_over_rmse": Figure("sigma over RMSE", error_statistics(X_C)["sigma_over_rmse"]),
    "force_rmse_pct": Figure("force RMSE, %", SUMMARY["force_rmse_pct"]),
    TIME: Figure("time over reference", TIME_OVER_REFERENCE),
    "ms_median": Figure("ms per frame", TIMES["ms_median"]),
}
