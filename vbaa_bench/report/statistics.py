"""Statistics of every method within one stratum, always computed from all frames."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import polars as pl

from vbaa_bench.scoring.bootstrap import Interval, group_numbers, median_interval
from vbaa_bench.scoring.efficiency import share_of_information
from vbaa_bench.scoring.scored_quantities import COVERAGE, SCORED_QUANTITIES
from vbaa_bench.scoring.summary import CONTACTS

# The RMSE over all frames counts a frame without an estimate as half the beam, as in `scoring`.
_FAILURE_ERROR_PCT_L: Final = 50.0


@dataclass(frozen=True)
class MethodStatistics:
    """Statistics of one method; errors of x_c in % of L. None: no frame has such a value.

    `contacts` and `free` count the frames with and without contact; `answered` those contacts that
    have an estimate; `right_refusals` contacts without, where this is right according to `scoring`;
    `false_contacts` free frames with an estimate. `coverage_95` is the fraction of the stated
    95 % intervals of x_c with the truth. `rmse_over_limit` is the RMS of the errors over the
    information limits of their frames, `matched` frames that have both.
    """

    method: str
    frames: int
    contacts: int
    free: int
    answered: int
    right_refusals: int
    false_contacts: int
    median: float | None
    p95: float | None
    worst: float | None
    rmse: float | None
    bias: float | None
    rmse_all: float | None
    force_rmse: float | None
    psi_rmse: float | None
    compliance_rmse: float | None
    coverage_95: float | None
    ms: float | None
    matched: int
    rmse_over_limit: float | None
    information: str | None
    median_95: Interval | None
    ms_95: Interval | None

    @property
    def share_answered(self) -> float | None:
        """Fraction of the contacts that have an estimate."""
        return self.answered / self.contacts if self.contacts else None

    @property
    def efficiency(self) -> float | None:
        """Fraction of the available information that the method uses, as in `scoring`."""
        return share_of_information(self.rmse_over_limit, self.matched)


def with_groups(scores: pl.DataFrame) -> pl.DataFrame:
    """Add the column `group`, the number of the push (in a collection: of the rig)."""
    over = ["rig"] if "rig" in scores.columns else None
    return scores.with_columns(group=group_numbers(scores, over))


def statistics(rows: pl.DataFrame) -> dict[str, MethodStatistics]:
    """Compute the statistics of every method in `rows`, scores with `group` and limits."""
    records = rows.group_by("method").agg(**_aggregates()).to_dicts()
    intervals = {
        str(name): (_interval(part, "x_c_error_pct_L"), _interval(part, "image_ms"))
        for (name,), part in rows.select("method", "group", "x_c_error_pct_L", "image_ms").group_by(
            "method"
        )
    }
    return {
        record["method"]: MethodStatistics(
            **{name: _finite(value) for name, value in record.items()},
            median_95=intervals[record["method"]][0],
            ms_95=intervals[record["method"]][1],
        )
        for record in records
    }


def _aggregates() -> dict[str, pl.Expr]:
    free, failed = pl.col("free"), pl.col("failed")
    error = pl.col("x_c_error_pct_L")
    in_sigmas = next(one for one in SCORED_QUANTITIES if one.name == "x_c").in_sigmas
    size, limit = pl.col(in_sigmas).abs(), pl.col("x_c_limit_pct_L")
    required = error.fill_null(_FAILURE_ERROR_PCT_L).filter(~free & ~pl.col("rightly_refused"))
    matched = error.is_not_null() & limit.is_not_null()
    return {
        "frames": pl.len(),
        "contacts": (~free).sum(),
        "free": free.sum(),
        "answered": (~free & ~failed).sum(),
        "right_refusals": (~free & pl.col("rightly_refused")).sum(),
        "false_contacts": (free & pl.col("outcome").is_in(CONTACTS)).sum(),
        "median": error.abs().median(),
        "p95": error.abs().quantile(0.95, "linear"),
        "worst": error.abs().max(),
        "rmse": _rms(error),
        "bias": error.mean(),
        # Null for a method that estimates only forces.
        "rmse_all": pl.when(error.is_not_null().any() | pl.col("force_error_n").is_null().all())
        .then(_rms(required))
        .otherwise(None),
        "force_rmse": _rms(pl.col("force_error_pct")),
        "psi_rmse": _rms(pl.col("psi_error_deg")),
        "compliance_rmse": _rms(pl.col("compliance_error_pct")),
        "coverage_95": (size <= COVERAGE["coverage_95"]).mean(),
        "ms": pl.col("image_ms").median(),
        "matched": matched.sum(),
        "rmse_over_limit": _rms(error / limit),
        "information": pl.col("information").first(),
    }


def _rms(values: pl.Expr) -> pl.Expr:
    return (values**2).mean().sqrt()


def _interval(rows: pl.DataFrame, column: str) -> Interval | None:
    present = rows.drop_nulls(column)
    values = np.abs(present[column].to_numpy())
    return median_interval(values, present["group"].to_numpy()) if len(values) else None


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
