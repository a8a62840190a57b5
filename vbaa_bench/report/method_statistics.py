"""Statistics of every method within one stratum, always computed from all frames."""

from collections.abc import Mapping
from dataclasses import dataclass

import polars as pl

from vbaa_bench.scoring.bootstrap import Interval, group_numbers, median_interval
from vbaa_bench.scoring.statistics import ADDED, REPORTED


@dataclass(frozen=True)
class MethodStatistics:
    """Statistics `REPORTED` of one method; errors of x_c in % of L. None: no frame counts.

    `median_95` and `ms_95` are intervals over pushes. `information` is the method's information
    set, `efficiency` the share of its information that the method uses. `added` are the RMSEs of
    scores with a heading of their own, by this heading.
    """

    method: str
    frames: int
    contacts: int
    free: int
    answered: int
    right_refusals: int
    false_contacts: int
    coverage_95: float | None
    efficiency: float | None
    median: float | None
    bias: float | None
    rmse: float | None
    p95: float | None
    worst: float | None
    rmse_all: float | None
    rmse_over_limit: float | None
    force_rmse: float | None
    psi_rmse: float | None
    compliance_rmse: float | None
    ms: float | None
    information: str | None
    median_95: Interval | None
    ms_95: Interval | None
    added: Mapping[str, float | None]

    @property
    def share_answered(self) -> float | None:
        """Fraction of the contacts that have an estimate."""
        return self.answered / self.contacts if self.contacts else None


def with_groups(scores: pl.DataFrame) -> pl.DataFrame:
    """Add the column `group`, the number of the push (in a collection: of the rig)."""
    over = ["rig"] if "rig" in scores.columns else None
    return scores.with_columns(group=group_numbers(scores, over))


def method_statistics(rows: pl.DataFrame) -> dict[str, MethodStatistics]:
    """Compute the statistics of every method in `rows`, scores with `group` and limits."""
    figures = {name: statistic.expression for name, statistic in REPORTED.items()}
    figures["information"] = pl.col("information").first()
    figures |= {name: statistic.expression for name, statistic in ADDED.items()}
    parts = rows.select("method", "group", "x_c_error_pct_L", "image_ms").partition_by(
        "method", as_dict=True
    )
    methods = {}
    for row in rows.group_by("method").agg(**figures).to_dicts():
        part = parts[(row["method"],)]
        groups = part["group"].to_numpy()
        methods[row["method"]] = MethodStatistics(
            **{name: row[name] for name in ("method", *REPORTED, "information")},
            median_95=median_interval(part["x_c_error_pct_L"], groups),
            ms_95=median_interval(part["image_ms"], groups),
            added={one.heading.report: row[name] for name, one in ADDED.items()},
        )
    return methods
