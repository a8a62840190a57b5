"""Statistics of every method within one stratum, always computed from all frames."""

from collections.abc import Mapping
from dataclasses import dataclass

import polars as pl

from vbaa_bench.scoring.bootstrap import Interval, group_numbers, median_interval
from vbaa_bench.scoring.statistics import REPORT_TABLE, REPORTED


@dataclass(frozen=True)
class MethodStatistics:
    """Statistics `REPORTED` of one method; errors of x_c in % of L. None: no frame counts.

    `median_95` and `ms_95` are intervals over pushes. `information` is the method's information
    set, `efficiency` the share of its information that the method uses. `figures` are the
    statistics `REPORT_TABLE` by name.
    """

    method: str
    frames: int
    contacts: int
    free: int
    answered: int
    right_refusals: int
    false_contacts: int
    median: float | None
    ms: float | None
    information: str | None
    median_95: Interval | None
    ms_95: Interval | None
    figures: Mapping[str, float | None]

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
    figures = {name: one.expression for name, one in (REPORTED | REPORT_TABLE).items()}
    figures["information"] = pl.col("information").first()
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
            figures={name: row[name] for name in REPORT_TABLE},
        )
    return methods
