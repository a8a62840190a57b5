"""Summary of scores: one record per method."""

import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import polars as pl

from vbaa_bench.dataset.program import versions
from vbaa_bench.scoring.bootstrap import group_numbers, median_interval
from vbaa_bench.scoring.information import efficiency
from vbaa_bench.scoring.scored_quantities import (
    COMPLIANCE,
    COMPONENTS,
    COVERAGE,
    LIMITED,
    SCORED_QUANTITIES,
    ScoredQuantity,
)
from vbaa_bench.scoring.statistics import SUMMARY, compute, error_statistics
from vbaa_bench.scoring.strata import ALL

_CALIBRATION = (*COVERAGE, "within_3_sigma", "nees", "sigma_over_rmse")


def summarise(
    scores: pl.DataFrame,
    parameters: Sequence[dict[str, Any]] = (),
    over: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Summarise errors, failure rate and time as `methods.<name>`; add machine and versions.

    Failures count in `failure_rate` and `n`; errors are computed from frames with an estimate, null
    if there is none. Intervals are 95 % bootstrap intervals of the medians over pushes, or over
    groups of the columns `over`. From `parameters`, the rows of `strata_rows`, each method gets
    its `parameters` by quantity over all frames, and its `efficiency` by quantity.
    """
    methods = {
        str(name): summarise_method(rows)
        | _intervals(rows, over)
        | _parameters(rows, [row for row in parameters if row["method"] == name])
        for (name,), rows in scores.group_by("method", maintain_order=True)
    }
    return {"methods": methods, "machine": machine(), "versions": versions()}


def _parameters(rows: pl.DataFrame, parameters: Sequence[dict[str, Any]]) -> dict[str, Any]:
    overall = {row["quantity"]: row for row in parameters if row["stratum"] == ALL}
    heads = ("method", "stratum", "value", "quantity")
    (information, *others) = rows["information"].unique(maintain_order=True)
    used = {
        quantity.column: efficiency(information, quantity, overall[quantity.column])
        for quantity in LIMITED
        # Frames of different information sets have no share in common.
        if quantity.column in overall and not others
    }
    return {
        "parameters": {
            quantity: {key: value for key, value in row.items() if key not in heads}
            for quantity, row in overall.items()
        },
        "efficiency": {quantity: share for quantity, share in used.items() if share},
    }


def summarise_method(rows: pl.DataFrame) -> dict[str, Any]:
    """Summarise frames of one method, without bootstrap intervals.

    The record has the statistics of `SUMMARY`, null where no frame counts. `outcomes` counts
    outcomes, and `outcome_confusion` also by the true state of the frame, see
    `refusals.right_refusals`. `calibration` is by quantity, of all frames; that of the compliance
    also of rigid objects and of the last frames of pushes.
    """
    rigid = rows.filter(~pl.col("free") & pl.col("k_s_n_m").is_null())
    quantities = (*SCORED_QUANTITIES, *COMPONENTS)
    return {
        **compute(SUMMARY, rows),
        "calibration": {
            **{quantity.name: calibration(rows, quantity) for quantity in quantities},
            "compliance_rigid": calibration(rigid, COMPLIANCE),
            "compliance_last": calibration(rows.filter("last_step"), COMPLIANCE),
        },
        "outcomes": dict(rows["outcome"].value_counts(sort=True).iter_rows()),
        "outcome_confusion": _confusion(rows),
    }


def calibration(rows: pl.DataFrame, quantity: ScoredQuantity) -> dict[str, Any] | None:
    """Compare stated standard deviations with errors; return None if none is stated.

    The record has the number `n` of frames with both, and statistics of these frames.
    """
    stated = rows.drop_nulls([quantity.in_sigmas, quantity.error, quantity.sigma])
    if stated.is_empty():
        return None
    statistics = error_statistics(quantity)
    chosen = {name: statistics[name] for name in _CALIBRATION}
    return {"n": stated.height, **compute(chosen, stated)}


def _confusion(rows: pl.DataFrame) -> dict[str, dict[str, int]]:
    """Count the outcomes by true state; a frame without a prediction counts as crashed."""
    counts = rows.group_by("true_state", "outcome").len().sort("true_state", "outcome")
    confusion: dict[str, dict[str, int]] = {}
    for state, outcome, count in counts.iter_rows():
        confusion.setdefault(state, {})[outcome] = count
    return confusion


def _intervals(rows: pl.DataFrame, over: Sequence[str] | None) -> dict[str, Any]:
    groups = group_numbers(rows, over)
    return {
        "x_c_median_abs_pct_L_95": _listed(median_interval(rows["x_c_error_pct_L"], groups)),
        "ms_per_frame_median_95": _listed(median_interval(rows["image_ms"], groups)),
    }


def _listed(ends: Sequence[float] | None) -> list[float] | None:
    return None if ends is None else list(ends)


def machine() -> dict[str, Any]:
    """Describe the machine on which times were measured: processor, cores and system."""
    model = platform.processor() or platform.machine()
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        names = [
            line.partition(":")[2].strip()
            for line in listing.read_text(encoding="utf-8").splitlines()
            if line.startswith("model name")
        ]
        model = names[0] if names else model
    system = f"{platform.system()} {platform.machine()}"
    return {"processor": model, "cores": os.cpu_count(), "system": system}
