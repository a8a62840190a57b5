"""Measure the time and memory of scoring and reporting a large dataset from stored predictions."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from results.score_speed.enlarged import enlarge
from solver.instrument.errors import InputError
from solver.instrument.safe_path import PYTHON

STAGES: Final = ("score", "report")


def measure(source: Path, frames: int, methods: Sequence[str] = ()) -> dict[str, Any]:
    """Enlarge a solved dataset; score and report the large one, each in a fresh process.

    The large dataset is beside the small one, because its images are hard links, and is removed at
    the end. The record has the seconds, the processor time [s] and the peak memory [GB] of each
    stage. Raises InputError, also if a stage fails.
    """
    if sys.platform == "win32":
        raise InputError("speed scores measures memory, which it cannot do on Windows")
    with tempfile.TemporaryDirectory(prefix="speed_scores_", dir=source.parent) as folder:
        large = Path(folder) / "large"
        names = enlarge(source, large, frames, methods)
        stages = {stage: _run(stage, large) for stage in STAGES}
    return {"dataset": str(source), "frames": frames, "methods": names, **stages}


def _run(stage: str, dataset: Path) -> dict[str, float]:
    """Run a command on a dataset in a fresh process, and measure it."""
    command = [*PYTHON, "-m", "vbaa_bench", stage, str(dataset), "--json"]
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    process.returncode = status
    if status:
        raise InputError(f"{dataset}: vbaa-bench {stage} failed")
    # In bytes on macOS, in units of 1024 bytes elsewhere.
    unit = 1 if sys.platform == "darwin" else 1024
    return {
        "seconds": seconds,
        "processor_s": usage.ru_utime + usage.ru_stime,
        "peak_gb": usage.ru_maxrss * unit / 1e9,
    }
