"""Measure each method's time, from an image in memory and from points, all in one process.

The measuring process has no access to the truth: it gets a copy of the observations, and returns
its estimates to be scored.
"""

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import open_observations
from solver.instrument.safe_path import PYTHON
from solver.methods import METHODS
from solver.set_up import set_up
from solver.tracker import PushTracker
from vbaa_bench.benchmarks.method_runs import BATCHES, Record, Run

# Variables that a process needs, and one thread for every library: times are of one core.
_ENVIRONMENT: Final = ("PATH", "HOME", "LANG", "LD_LIBRARY_PATH", "SYSTEMROOT")
_ONE_THREAD: Final = ("OMP", "OPENBLAS", "MKL", "NUMBA")


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
    for name in methods:
        if name not in METHODS:
            allowed = ", ".join(METHODS)
            raise InputError(f"method '{name}' is unknown, allowed is one of {allowed}")
    with tempfile.TemporaryDirectory(prefix="vbaa-speed-") as folder:
        copy = Path(folder) / "observations"
        shutil.copytree(observations, copy)
        record = _child(folder, "measure", copy, most_frames, repeats, *methods)
        for name in methods:
            result = record["methods"][name]
            result["cold_start"] = _child(folder, "start_cold", copy, name, repr(time.time()))
            result["first_start"] = _first_start(folder, copy, name) if first_ever else None
    return record


def measure(observations: Path, methods: Sequence[str], most_frames: int, repeats: int) -> Record:
    """Measure the seconds of every method on some frames of a dataset, and its estimates.

    All methods take turns, `repeats` times after one warm-up round, so that a slowdown of the
    machine affects all. A frame's time is the median over the repeats, a method's time the median
    over the frames. The methods of BATCHES solve the points of all frames at once, too.
    `predictions` is a method's table of estimates, as CSV.
    """
    opened = open_observations(observations)
    frames = chosen(opened.frames, most_frames)
    images, decode_times = [], []
    for frame in frames:
        start = time.perf_counter()
        images.append(frame.image())
        decode_times.append(time.perf_counter() - start)
    start = time.perf_counter()
    antenna = set_up(opened)
    set_up_s = time.perf_counter() - start
    runs = {name: Run(METHODS[name], BATCHES.get(name), antenna, len(frames)) for name in methods}
    for _ in range(1 + repeats):
        for run in runs.values():
            run.once(frames, images)
    extraction = [run.image_s - run.method_s for run in runs.values()]
    return {
        "frames": len(frames),
        "image_px": [images[0].shape[1], images[0].shape[0]],
        "image_bits": 8 * images[0].itemsize,
        "repeats": repeats,
        "decode_ms_per_frame": 1e3 * statistics.median(decode_times),
        "extract_ms_per_frame": 1e3 * float(np.median(extraction)),
        "set_up_s": set_up_s,
        "methods": {name: run.record(frames) for name, run in runs.items()},
    }


def start_cold(observations: Path, name: str, launched: float) -> Record:
    """Time the first estimate of a process that was launched at `launched` [Unix time]."""
    imported = time.time()
    opened = open_observations(observations)
    first = opened.frames[0]
    image = first.image()
    start = time.time()
    antenna = set_up(opened)
    ready = time.time()
    PushTracker(antenna, METHODS[name]).solve(image, first.readings, first.push_id)
    done = time.time()
    return {
        "import_s": imported - launched,
        "set_up_s": ready - start,
        "first_image_ms": 1e3 * (done - ready),
        "total_s": done - launched,
    }


def chosen(frames: Sequence[ImageFrame], most: int) -> list[ImageFrame]:
    """Choose whole pushes, evenly spread, of at most `most` frames in total, or one push.

    The frames of a push are in the order of their steps.
    """
    pushes: dict[str, list[ImageFrame]] = {}
    for frame in frames:
        pushes.setdefault(frame.push_id or frame.frame_id, []).append(frame)
    longest = max(map(len, pushes.values()))
    count = max(min(len(pushes), most // longest), 1)
    indices = np.unique(np.linspace(0, len(pushes) - 1, count).round().astype(int))
    ordered = [pushes[name] for name in sorted(pushes)]
    return [picked for index in indices for picked in sorted(ordered[index], key=lambda f: f.step)]


def _first_start(folder: str, observations: Path, name: str) -> Record:
    """Run `start_cold` where no code has been compiled before."""
    with tempfile.TemporaryDirectory(prefix="compiled-", dir=folder) as empty:
        return _child(folder, "start_cold", observations, name, repr(time.time()), compiled=empty)


def _child(folder: str, *arguments: object, compiled: str | None = None) -> Record:
    """Run a fresh process and return its record.

    Compiled code is cached in the folder `compiled`, or in the usual place.
    """
    environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
    environment |= {f"{name}_NUM_THREADS": "1" for name in _ONE_THREAD}
    environment["OPENCV_FOR_THREADS_NUM"] = "1"
    if compiled is not None:
        environment["NUMBA_CACHE_DIR"] = compiled
    command = [*PYTHON, "-m", "vbaa_bench.benchmarks.speed_solve", *map(str, arguments)]
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


def _main(verb: str, observations: str, *options: str) -> Record:
    if verb == "start_cold":
        return start_cold(Path(observations), options[0], float(options[1]))
    most_frames, repeats, *methods = options
    return measure(Path(observations), methods, int(most_frames), int(repeats))


if __name__ == "__main__":
    print(json.dumps(_main(*sys.argv[1:])))
