"""Rate and memory of a long run, sampled while it renders."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.errors import InputError
from vbaa_bench.benchmarks.endurance.runs import children, last_message, started, write_scene
from vbaa_bench.benchmarks.process_memory import memory_mb

_PER_SHARD: Final = 50
# Seconds between samples. Chosen: hundreds of samples of a run of an hour.
_INTERVAL_S: Final = 5.0
# Share of the run that starts workers and compiles kernels, and is left out. Chosen.
_START: Final = 0.05


class Sample(NamedTuple):
    """Time [s], finished frames, and memory of all processes together and of the parent [MB]."""

    seconds: float
    frames: int
    memory_mb: float
    parent_mb: float


class LongRun(NamedTuple):
    """Frames, hours, and first and last tenth of a run: rates [1/s] and memory [MB]."""

    frames: int
    hours: float
    first_rate: float
    last_rate: float
    first_mb: float
    last_mb: float
    first_parent_mb: float
    last_parent_mb: float


def long_run(
    folder: Path, frames: int, workers: int, progress: Callable[[int, int], None]
) -> LongRun:
    """Generate a dataset of small images in the empty `folder`, and sample it while it runs.

    Raises InputError if it fails, or on a system without /proc.
    """
    if not Path("/proc").is_dir():
        raise InputError("endurance long reads /proc, which this system does not have")
    folder.mkdir(parents=True, exist_ok=True)
    scene, out = write_scene(folder / "scene.yaml", frames, _PER_SHARD), folder / "data"
    start, samples = time.monotonic(), list[Sample]()
    process = started(scene, out, "--workers", str(workers))
    while process.poll() is None:
        count = _PER_SHARD * len(list(out.glob("observations/shard_*")))
        parent = memory_mb(process.pid)
        memory = parent + sum(map(memory_mb, children(process.pid)))
        samples.append(Sample(time.monotonic() - start, count, memory, parent))
        progress(count, frames)
        time.sleep(_INTERVAL_S)
    if process.returncode:
        log = folder / "data.log"
        raise InputError(f"{out}: generate failed: {last_message(log)}")
    return summary(samples, frames)


def summary(samples: list[Sample], frames: int) -> LongRun:
    """Compare the first and the last tenth of the frames, after the start.

    Raises InputError if there are too few samples.
    """
    rendering = [one for one in samples if _START * frames < one.frames < frames]
    table = np.array(rendering).reshape(-1, len(Sample._fields))
    tenth = len(table) // 10
    if tenth < 2:
        raise InputError(
            f"{len(samples)} samples are too few, allowed are runs of {frames} frames "
            f"that take more than {20 * _INTERVAL_S:g} s"
        )
    first, last = table[:tenth], table[-tenth:]

    def rate(part: np.ndarray) -> float:
        return float((part[-1, 1] - part[0, 1]) / (part[-1, 0] - part[0, 0]))

    memory = [float(np.median(part[:, column])) for column in (2, 3) for part in (first, last)]
    hours = samples[-1].seconds / 3600
    return LongRun(frames, hours, rate(first), rate(last), *memory)
