"""Errors for the measurements of `benchmarks.speed_solve`, compared with the truth."""

import io
from dataclasses import replace
from typing import Any

import polars as pl

from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.metrics import checked_predictions, score_frames
from vbaa_bench.scoring.summary import machine, summarise_method

# Values of `summarise_method` that are listed beside a method's speed.
_REPORTED = (
    "x_c_rmse_pct_L",
    "x_c_median_abs_pct_L",
    "force_rmse_pct",
    "psi_rmse_deg",
    "compliance_rmse_pct",
    "failure_rate",
    "outcomes",
    "n",
)


def judged(truth: Truth, measured: dict[str, Any]) -> dict[str, Any]:
    """Replace the predictions in a record of speeds by their errors."""
    methods = {}
    for name, record in measured["methods"].items():
        table = pl.read_csv(io.StringIO(record["predictions"]), infer_schema=False)
        predictions = checked_predictions(table, name)
        solved_truth = replace(
            truth, frames=truth.frames.join(predictions, on="frame_id", how="semi")
        )
        summary = summarise_method(score_frames(solved_truth, predictions, name, name))
        times = {key: value for key, value in record.items() if key != "predictions"}
        methods[name] = times | {key: summary[key] for key in _REPORTED}
    return {**measured, "methods": methods, "machine": machine()}
