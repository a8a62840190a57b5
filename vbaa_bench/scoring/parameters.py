"""Errors of each method by quantity and stratum, in units of the information limit as well.

Bias and RMSE over the limit are the figures of DECODE (Speiser et al. 2021). Where limits differ
from frame to frame, each error is divided by its own limit before it is averaged.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.scoring.bootstrap import DRAWS, Interval, draws, group_numbers, interval
from vbaa_bench.scoring.conditions import STRATA
from vbaa_bench.scoring.scored_quantities import (
    COVERAGE,
    LIMITED,
    SCORED_QUANTITIES,
    ScoredQuantity,
)
from vbaa_bench.scoring.strata import class_order

Row = dict[str, Any]

# Name of the stratum that contains all frames.
ALL: Final = "all"
# Figures with an interval: each is a ratio of two of `_SUMS`, or its root.
RATIOS: Final = {
    "bias": ("error", "n"),
    "rmse": ("square", "n"),
    "bias_over_limit": ("in_limits", "limited"),
    "rmse_over_limit": ("in_limits_square", "limited"),
    **{name: (f"within_{name}", "stated") for name in COVERAGE},
    "nees": ("in_sigmas_square", "stated"),
}
_ROOTS: Final = ("rmse", "rmse_over_limit")
_SUMS: Final = (
    "n",
    "error",
    "square",
    "limited",
    "in_limits",
    "in_limits_square",
    "stated",
    *(f"within_{name}" for name in COVERAGE),
    "in_sigmas_square",
)


def parameter_rows(scores: pl.DataFrame, over: Sequence[str] | None = None) -> list[Row]:
    """Tabulate figures per method, stratum and quantity that the method estimates.

    A row's unit is that of its `quantity`, a column of the predictions. `frames` counts all frames
    of the stratum, `answered` those with this quantity, `failed` the failures among all frames.
    Each figure of `RATIOS` has a 95 % bootstrap interval over pushes, `<figure>_low` and
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
    figures = rows.group_by("_value", maintain_order=True).agg(
        *_counts_and_times(), *(e for quantity in quantities for e in _order_figures(quantity))
    )
    sums = rows.group_by("_value", "_group", maintain_order=True).agg(
        expression for quantity in quantities for expression in _sums(quantity)
    )
    for facts in sorted(figures.to_dicts(), key=lambda row: class_order(row["_value"])):
        of_value = sums.filter(pl.col("_value") == facts["_value"])
        numbers = of_value["_group"].to_numpy()
        drawn_counts = counts[:, numbers] if counts.shape[1] and len(numbers) > 1 else None
        for quantity in quantities:
            if not facts[f"{quantity.name} answered"]:
                continue
            table = of_value.select(f"{quantity.name} {name}" for name in _SUMS).to_numpy()
            totals = dict(zip(_SUMS, table.sum(axis=0), strict=True))
            drawn = None
            if drawn_counts is not None:
                drawn = dict(zip(_SUMS, (drawn_counts @ table).T, strict=True))
            yield {
                "value": facts["_value"],
                "quantity": quantity.column,
                **{name: facts[name] for name in ("frames", "failed", "crashed", "refused")},
                **{
                    name: facts[f"{quantity.name} {name}"]
                    for name in ("answered", "median_abs", "p95_abs", "worst_abs", "worst_frame")
                },
                **_ratios(totals, drawn),
                "sigma_over_rmse": facts[f"{quantity.name} sigma_over_rmse"],
                **{name: facts[name] for name in ("ms_median", "ms_p05", "ms_p95")},
            }


def _ratios(totals: dict[str, Any], drawn: dict[str, Floats] | None) -> Row:
    """Compute the figures of RATIOS from sums, with intervals from the sums of all draws."""
    row: Row = {}
    for name, (numerator, denominator) in RATIOS.items():
        row[name] = _ratio(name, totals[numerator], totals[denominator])
        ends: Interval | tuple[None, None] | None = None
        if drawn is not None and row[name] is not None:
            with np.errstate(invalid="ignore", divide="ignore"):
                ratios = drawn[numerator] / drawn[denominator]
            ends = interval(np.sqrt(ratios) if name in _ROOTS else ratios)
        row[f"{name}_low"], row[f"{name}_high"] = ends or (None, None)
    return row


def _ratio(name: str, numerator: float, denominator: float) -> float | None:
    if not denominator:
        return None
    ratio = numerator / denominator
    return float(np.sqrt(ratio) if name in _ROOTS else ratio)


def _counts_and_times() -> Iterable[pl.Expr]:
    time = pl.col("image_ms")
    yield pl.len().alias("frames")
    yield from (pl.col(name).sum() for name in ("failed", "crashed", "refused"))
    yield time.median().alias("ms_median")
    yield time.quantile(0.05, "linear").alias("ms_p05")
    yield time.quantile(0.95, "linear").alias("ms_p95")


def _order_figures(quantity: ScoredQuantity) -> Iterable[pl.Expr]:
    error, sigma = pl.col(quantity.error), pl.col(quantity.sigma)
    magnitude, stated = error.abs(), pl.col(quantity.in_sigmas).is_not_null()
    figures = {
        "answered": error.count(),
        "median_abs": magnitude.median(),
        "p95_abs": magnitude.quantile(0.95, "linear"),
        "worst_abs": magnitude.max(),
        "worst_frame": pl.col("frame_id").get(magnitude.fill_null(-1.0).arg_max()),
        "sigma_over_rmse": sigma.filter(stated).mean() / (error.filter(stated) ** 2).mean().sqrt(),
    }
    return [figure.alias(f"{quantity.name} {name}") for name, figure in figures.items()]


def _sums(quantity: ScoredQuantity) -> Iterable[pl.Expr]:
    error, in_sigmas = pl.col(quantity.error), pl.col(quantity.in_sigmas)
    limit = pl.col(quantity.limit) if quantity in LIMITED else pl.lit(None, pl.Float64)
    in_limits = error / limit
    sums = {
        "n": error.count(),
        "error": error.sum(),
        "square": (error**2).sum(),
        "limited": in_limits.count(),
        "in_limits": in_limits.sum(),
        "in_limits_square": (in_limits**2).sum(),
        "stated": in_sigmas.count(),
        **{
            f"within_{name}": (in_sigmas.abs() <= sigmas).sum() for name, sigmas in COVERAGE.items()
        },
        "in_sigmas_square": (in_sigmas**2).sum(),
    }
    return [sums[name].cast(pl.Float64).alias(f"{quantity.name} {name}") for name in _SUMS]
