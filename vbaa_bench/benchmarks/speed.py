"""Measure each method's time, from an image in memory and from points, and its error.

Times are measured in a fresh process, which gets a copy of the observations; here its estimates are
compared with the truth.
"""

import io
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.safe_path import PYTHON
from solver.methods import METHODS
from solver.methods.by_name import check_known
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.frame_scores import score_frames
from vbaa_bench.scoring.isolation.runs import one_core_environment
from vbaa_bench.scoring.predictions import checked_predictions
from vbaa_bench.scoring.summary import machine, summarise_method

Record = dict[str, Any]
# Values of `summarise_method` that are listed beside a method's speed.
_REPORTED: Final = (
    "x_c_rmse_pct_L",
    "x_c_median_abs_pct_L",
    "force_rmse_pct",
    "psi_rmse_deg",
    "compliance_rmse_pct",
    "failure_rate",
    "outcomes",
    "n",
)


def measure_apart(
    observations: Path,
    methods: Sequence[str] | None,
    most_frames: int,
    repeats: int,
    *,
    first_ever: bool = True,
) -> Record:
    """Run `measure` in a fresh process on one thread, and each method's cold start in another.

    For `cold_start` an earlier process has compiled all code, as in all starts but the first.
    `first_start` compiles all that the method needs, as after an installation; it is None
    without `first_ever`. Without `methods`, all are measured. Raises InputError where one is
    unknown, and where the observations cannot be solved.
    """
    methods = methods or list(METHODS)
    check_known(methods)
    with tempfile.TemporaryDirectory(prefix="vbaa-speed-") as folder:
        copy = Path(folder) / "observations"
        shutil.copytree(observations, copy)
        record = _child(folder, "measure", copy, most_frames, repeats, *methods)
        for name in methods:
            result = record["methods"][name]
            result["cold_start"] = _child(folder, "start_cold", copy, name, repr(time.time()))
            result["first_start"] = _first_start(folder, copy, name) if first_ever else None
    return record


def with_errors(truth: Truth, measured: Record) -> Record:
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


def _first_start(folder: str, observations: Path, name: str) -> Record:
    """Run `start_cold` where no code has been compiled before."""
    with tempfile.TemporaryDirectory(prefix="compiled-", dir=folder) as empty:
        return _child(folder, "start_cold", observations, name, repr(time.time()), compiled=empty)


def _child(folder: str, *arguments: object, compiled: str | None = None) -> Record:
    """Run a fresh process and return its record.

    Compiled code is cached in the folder `compiled`, or in the usual place.
    """
    environment = one_core_environment()
    if compiled is not None:
        environment["NUMBA_CACHE_DIR"] = compiled
    command = [*PYTHON, "-m", "vbaa_bench.benchmarks.speed_process", *map(str, arguments)]
    completed = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if completed.returncode:
        message = (
            completed.stderr.strip().splitlines() or [f"exit status {completed.returncode}"]
        )[-1]
        raise InputError(
            f"the methods could not be measured: {message}".replace(folder + os.sep, "")
        )
    record: Record = json.loads(completed.stdout)
    return record
