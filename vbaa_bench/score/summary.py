"""Scores of all frames -> one record a method."""

import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.stats import bootstrap

from solver.instrument.arrays import Floats
from vbaa_bench.dataset.manifest import versions


def summarise(scores: pl.DataFrame) -> dict[str, Any]:
    """`methods.<name>` with errors, failure rate and time; the machine and versions beside it.

    Failures count in `failure_rate` and `n`; errors are of the frames that were answered, null
    if there is none. Intervals are 95 % bootstrap intervals of the medians over pushes.
    """
    methods = {
        str(name): _method(rows) for (name,), rows in scores.group_by("method", maintain_order=True)
    }
    return {"methods": methods, "machine": machine(), "versions": versions()}


def _method(rows: pl.DataFrame) -> dict[str, Any]:
    x_c = np.abs(_values(rows, "x_c_error_pct_L"))
    s_c = _values(rows, "s_c_error_pct_L")
    force = _values(rows, "force_error_pct")
    times = _values(rows, "image_ms")
    return {
        "x_c_rmse_pct_L": _rms(x_c),
        "x_c_median_abs_pct_L": _quantile(x_c, 0.5),
        "x_c_median_abs_pct_L_95": median_interval(_grouped(rows, "x_c_error_pct_L")),
        "x_c_p95_abs_pct_L": _quantile(x_c, 0.95),
        "s_c_rmse_pct_L": _rms(s_c),
        "force_rmse_pct": _rms(force),
        "force_median_abs_pct": _quantile(np.abs(force), 0.5),
        "failure_rate": float(rows["failed"].mean() or 0.0),  # type: ignore[arg-type]
        "ms_per_frame_median": _quantile(times, 0.5),
        "ms_per_frame_median_95": median_interval(_grouped(rows, "image_ms")),
        "n": rows.height,
    }


def median_interval(groups: Sequence[Floats]) -> list[float] | None:
    """95 % bootstrap interval of the median of |values|; None for fewer than two groups.

    Whole groups are drawn, each the repeats of one push: repeats err alike, and counting them
    as independent would make the interval too narrow.
    """
    if len(groups) < 2:
        return None
    sizes = [np.abs(group) for group in groups]
    everything = np.concatenate(sizes)
    if np.ptp(everything) == 0:
        return [float(everything[0])] * 2

    def median(drawn: Floats) -> float:
        return float(np.median(np.concatenate([sizes[int(index)] for index in drawn])))

    found = bootstrap(
        (np.arange(len(sizes)),),
        median,
        n_resamples=1000,
        vectorized=False,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return [float(found.low), float(found.high)]


def _grouped(rows: pl.DataFrame, column: str) -> list[Floats]:
    """Values of a column, one array a push: the same object at the same place, pushed as far."""
    same = ("push", "contact_distance_at_rest_mm", "normal_deg", "k_s_n_m")
    pushes = rows.drop_nulls(column).group_by(*same, maintain_order=True)
    return [_values(group, column) for _, group in pushes]


def machine() -> dict[str, Any]:
    """Processor, cores and system on which the times were taken."""
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


def _values(rows: pl.DataFrame, column: str) -> Floats:
    return np.asarray(rows[column].drop_nulls().to_numpy(), dtype=np.float64)


def _rms(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def _quantile(values: Floats, share: float) -> float | None:
    return float(np.quantile(values, share)) if len(values) else None
