"""Process that times methods, from an image in memory and from points, and returns their estimates.

It has no access to the truth. Its arguments are `measure` OBSERVATIONS FRAMES REPEATS METHOD..., or
`start_cold` OBSERVATIONS METHOD LAUNCHED.
"""

import json
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from solver.antenna import Antenna
from solver.instrument.arrays import Floats, Grey
from solver.instrument.estimate import Estimate
from solver.instrument.image_frame import ImageFrame
from solver.instrument.measurement import Measurement
from solver.instrument.observation import open_observations
from solver.lab.table import csv_text, row
from solver.methods import METHODS, Method
from solver.set_up import set_up
from solver.tracker import PushTracker

Record = dict[str, Any]


def measure(observations: Path, methods: Sequence[str], most_frames: int, repeats: int) -> Record:
    """Measure the seconds of every method on some frames of a dataset, and its estimates.

    All methods take turns, `repeats` times after one warm-up round, so that a slowdown of the
    machine affects all. A frame's time is the median over the repeats, a method's time the median
    over the frames. `predictions` is a method's table of estimates, as CSV.
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
    runs = {name: Run(METHODS[name], antenna, len(frames)) for name in methods}
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


class _TimedMethod:
    """Wrapper of a method that records its last measurement and its time [s]."""

    def __init__(self, method: Method) -> None:
        self._method = method
        self.measurement: Measurement | None = None
        self.seconds = 0.0

    def reset(self) -> None:
        """Reset the record before a frame, which may not reach the method."""
        self.measurement, self.seconds = None, 0.0

    def __call__(self, measurement: Measurement) -> Estimate:
        self.measurement = measurement
        start = time.perf_counter()
        try:
            return self._method(measurement)
        finally:
            self.seconds = time.perf_counter() - start


class Run:
    """Rounds of one method over the same frames; the first round is a warm-up."""

    def __init__(self, method: Method, antenna: Antenna, frames: int) -> None:
        self._method, self._antenna = method, antenna
        self._estimates: list[Estimate] = []
        self._images: list[Floats] = []
        self._in_method: list[Floats] = []
        self._points: list[Floats] = []
        self._frames = frames

    def once(self, frames: Sequence[ImageFrame], images: Sequence[Grey]) -> None:
        """Solve every frame once from its image, and once from its points."""
        timed = _TimedMethod(self._method)
        tracker = PushTracker(self._antenna, timed)
        from_image, in_method, from_points = (np.full(self._frames, np.nan) for _ in range(3))
        self._estimates = []
        for i, (frame, pixels) in enumerate(zip(frames, images, strict=True)):
            timed.reset()
            solved = tracker.solve(pixels, frame.readings, frame.push_id)
            from_image[i], in_method[i] = solved.seconds, timed.seconds
            if timed.measurement is not None:
                from_points[i] = _seconds(partial(self._method, timed.measurement))
            self._estimates.append(solved.estimate)
        self._images.append(from_image)
        self._in_method.append(in_method)
        self._points.append(from_points)

    @property
    def image_s(self) -> Floats:
        """Seconds of each frame from image to estimate (n,)."""
        return _typical(self._images)

    @property
    def method_s(self) -> Floats:
        """Seconds of each frame in the method itself (n,)."""
        return _typical(self._in_method)

    def record(self, frames: Sequence[ImageFrame]) -> Record:
        """Convert times and estimates to a record."""
        from_points = _typical(self._points)
        rows = [
            row(frame.frame_id, estimate, 1e3 * seconds)
            for frame, estimate, seconds in zip(frames, self._estimates, self.image_s, strict=True)
        ]
        return {
            "image_ms_per_frame": 1e3 * float(np.median(self.image_s)),
            "image_ms_p95": 1e3 * float(np.quantile(self.image_s, 0.95)),
            "points_us_per_frame": _microseconds(from_points),
            "predictions": csv_text(rows),
        }


def _typical(rounds: Sequence[Floats]) -> Floats:
    """Compute each frame's median over all rounds but the first, (n,)."""
    return np.asarray(np.median(rounds[1:] or rounds, axis=0))


def _microseconds(seconds: Floats) -> float | None:
    """Compute the median of the finite times in microseconds; return None if there are none."""
    finite = seconds[np.isfinite(seconds)]
    return 1e6 * float(np.median(finite)) if len(finite) else None


def _seconds(call: Callable[[], object]) -> float:
    """Time a call [s]; return NaN where it fails, which the table of estimates shows."""
    start = time.perf_counter()
    try:
        call()
    except Exception:  # noqa: BLE001 - a method may raise any error
        return float("nan")
    return time.perf_counter() - start


def _main(verb: str, observations: str, *options: str) -> Record:
    if verb == "start_cold":
        return start_cold(Path(observations), options[0], float(options[1]))
    most_frames, repeats, *methods = options
    return measure(Path(observations), methods, int(most_frames), int(repeats))


if __name__ == "__main__":
    print(json.dumps(_main(*sys.argv[1:])))
