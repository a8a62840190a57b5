"""Errors of each method by quantity and stratum, in units of the information limit as well.

Bias and RMSE over the limit are the figures of DECODE (Speiser et al. 2021). Where limits differ
from frame to frame, each error is divided by its own limit before it is averaged.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.scoring.bootstrap import DRAWS, draws, group_numbers, interval
from vbaa_bench.scoring.conditions import STRATA
from vbaa_bench.scoring.scored_quantities import SCORED_QUANTITIES, ScoredQuantity
from vbaa_bench.scoring.statistics import (
    AVERAGES,
    ORDERS,
    RMS,
    TIMES,
    Statistic,
    error_statistics,
)
from vbaa_bench.scoring.strata import ALL, class_order

Row = dict[str, Any]

_COUNTS: Final = ("failed", "crashed", "refused")
_OF_ERRORS: Final = ("answered", *ORDERS, "worst_frame")


def strata_rows(scores: pl.DataFrame, over: Sequence[str] | None = None) -> list[Row]:
    """Tabulate figures per method, stratum and quantity that the method estimates.

    A row's unit is that of its `quantity`, a column of the predictions. `frames` counts all frames
    of the stratum, `answered` those with this quantity, `failed` the failures among all frames.
    Each statistic of `AVERAGES` has a 95 % bootstrap interval over pushes, `<figure>_low` and
    `<figure>_high`, or over groups of the columns `over`; null for fewer than two groups. Strata
    with a single value are left out, because "all" has the same figures.
    """
    rows: list[Row] = []
    for (method,), of_method in scores.group_by("method", maintain_order=True):
        quantities = [
            quantity for quantity in SCORED_QUANTITIES if of_method[quantity.error].count()
        ]
        numbered = of_method.with_columns(_group=group_numbers(of_method, over))
        groups = numbered["_group"].n_unique()
        counts = draws(groups) if groups > 1 else np.empty((DRAWS, 0))
        for stratum in (ALL, *STRATA):
            values = numbered.with_columns(
                _value=pl.lit(ALL) if stratum == ALL else pl.col(stratum).fill_null("")
            )
            if stratum == ALL or values["_value"].n_unique() > 1:
                heads = {"method": method, "stratum": stratum}
                rows += [heads | row for row in _stratum_rows(values, quantities, counts)]
    return rows


def _stratum_rows(
    rows: pl.DataFrame, quantities: Sequence[ScoredQuantity], counts: Floats
) -> Iterator[Row]:
    """Yield the rows of one stratum of one method, whose values are in the column `_value`."""
    statistics = {quantity.name: error_statistics(quantity) for quantity in quantities}
    figures = rows.group_by("_value", maintain_order=True).agg(
        pl.len().alias("frames"),
        *(pl.col(name).sum() for name in _COUNTS),
        *(time.expression.alias(name) for name, time in TIMES.items()),
        *(e for q in quantities for e in _figures(q, statistics[q.name])),
    )
    sums_of = {name: _sums(of_quantity) for name, of_quantity in statistics.items()}
    sums = rows.group_by("_value", "_group", maintain_order=True).agg(
        total.alias(f"{name} {of}")
        for name, expressions in sums_of.items()
        for of, total in expressions.items()
    )
    for facts in sorted(figures.to_dicts(), key=lambda row: class_order(row["_value"])):
        of_value = sums.filter(pl.col("_value") == facts["_value"])
        numbers = of_value["_group"].to_numpy()
        drawn_counts = counts[:, numbers] if counts.shape[1] and len(numbers) > 1 else None
        for quantity in quantities:
            if not facts[f"{quantity.name} answered"]:
                continue
            names = list(sums_of[quantity.name])
            table = of_value.select(f"{quantity.name} {name}" for name in names).to_numpy()
            totals = dict(zip(names, table.sum(axis=0), strict=True))
            drawn = None
            if drawn_counts is not None:
                drawn = dict(zip(names, (drawn_counts @ table).T, strict=True))
            yield {
                "value": facts["_value"],
                "quantity": quantity.column,
                **{name: facts[name] for name in ("frames", *_COUNTS)},
                **{name: facts[f"{quantity.name} {name}"] for name in _OF_ERRORS},
                **_averages(statistics[quantity.name], totals, drawn),
                "sigma_over_rmse": facts[f"{quantity.name} sigma_over_rmse"],
                **{name: facts[name] for name in TIMES},
            }


def _figures(quantity: ScoredQuantity, statistics: Mapping[str, Statistic]) -> Iterator[pl.Expr]:
    magnitude = pl.col(quantity.error).abs()
    figures = {
        "answered": magnitude.count(),
        "worst_frame": pl.col("frame_id").get(magnitude.fill_null(-1.0).arg_max()),
        **{name: statistics[name].expression for name in (*ORDERS, "sigma_over_rmse")},
    }
    for name, figure in figures.items():
        yield figure.alias(f"{quantity.name} {name}")


def _sums(statistics: Mapping[str, Statistic]) -> dict[str, pl.Expr]:
    """Return the sums from which averages follow: their terms, or squares of terms, and counts."""
    sums = {}
    for names in AVERAGES:
        sums[f"frames of {names[0]}"] = statistics[names[0]].values.count().cast(pl.Float64)
        for name in names:
            terms, is_rms = statistics[name].values, statistics[name].reduction is RMS
            sums[name] = (terms**2 if is_rms else terms).sum()
    return sums


def _averages(
    statistics: Mapping[str, Statistic],
    totals: Mapping[str, float],
    drawn: Mapping[str, Floats] | None,
) -> Row:
    """Compute the averages from sums, with intervals from the sums of all draws."""
    row: Row = {}
    for names in AVERAGES:
        frames = f"frames of {names[0]}"
        for name in names:
            root = np.sqrt if statistics[name].reduction is RMS else np.asarray
            row[name], ends = None, None
            if totals[frames]:
                row[name] = float(root(totals[name] / totals[frames]))
                if drawn is not None:
                    with np.errstate(invalid="ignore", divide="ignore"):
                        ends = interval(root(drawn[name] / drawn[frames]))
            row[f"{name}_low"], row[f"{name}_high"] = ends or (None, None)
    return row
