"""Statistics of every method within one stratum, always computed from all frames."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.scoring.bootstrap import (
    DRAWS,
    Interval,
    draws,
    group_numbers,
    interval,
    median_interval,
)
from vbaa_bench.scoring.ranking import FEWEST_GROUPS, TIME_OVER_REFERENCE, by_solve, statistic_draws
from vbaa_bench.scoring.statistics import REPORT_TABLE, REPORTED


@dataclass(frozen=True)
class MethodStatistics:
    """Statistics `REPORTED` of one method; errors of x_c in % of L. None: no frame counts.

    `median_95` and `ms_95` are intervals over pushes. `figures` are the
    statistics `REPORT_TABLE` by name. `median_draws` and `time_draws` (draws,) are the medians of
    the error and of the time over that of the reference kernel, in draws that all methods share;
    times are NaN where `solve` did not measure them, and both with too few pushes to compare.
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
    median_95: Interval | None
    ms_95: Interval | None
    figures: Mapping[str, float | None]
    median_draws: Floats
    time_draws: Floats

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
    timed = {"processor_ms", "reference_ms"} <= set(rows.columns)  # not in older versions
    columns = ("processor_ms", "reference_ms") if timed else ()
    names, groups = np.unique(rows["group"].to_numpy(), return_inverse=True)
    counts, without = draws(len(names)), np.full(DRAWS, np.nan)
    enough = len(names) >= FEWEST_GROUPS
    parts = (
        rows.select("method", "x_c_error_pct_L", "image_ms", *columns, number=groups)
    ).partition_by("method", as_dict=True)
    methods = {}
    for row in rows.group_by("method").agg(**figures).to_dicts():
        name, part = row["method"], parts[(row["method"],)]
        of_push = part["number"].to_numpy()
        medians = statistic_draws(REPORTED["median"], part, of_push, counts)
        times = statistic_draws(TIME_OVER_REFERENCE, part, of_push, counts) if timed else without
        methods[name] = MethodStatistics(
            **{figure: row[figure] for figure in ("method", *REPORTED)},
            median_95=interval(medians),
            ms_95=median_interval(part["image_ms"], of_push),
            figures={figure: row[figure] for figure in REPORT_TABLE},
            median_draws=medians if enough else without,
            time_draws=times if enough and by_solve(name) else without,
        )
    return methods
