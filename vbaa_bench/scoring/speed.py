"""Errors for the measurements of `checks.speed_solve`, from a comparison with the truth."""

import io
from dataclasses import replace
from typing import Any

import polars as pl

from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.metrics import checked_predictions, score_frames
from vbaa_bench.scoring.summary import facts, machine

# Values of `facts` that are listed beside a method's speed.
_SHOWN = (
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
    for name, found in measured["methods"].items():
        table = pl.read_csv(io.StringIO(found["predictions"]), infer_schema=False)
        answers = checked_predictions(table, name)
        seen = replace(truth, frames=truth.frames.join(answers, on="frame_id", how="semi"))
        summed_up = facts(score_frames(seen, answers, name, name))
        times = {key: value for key, value in found.items() if key != "predictions"}
        methods[name] = times | {key: summed_up[key] for key in _SHOWN}
    return {**measured, "methods": methods, "machine": machine()}
