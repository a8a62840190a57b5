"""Repeated rounds of one method over the same frames: their times and estimates."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from solver.antenna import Antenna
from solver.fitting.batch import exact_fit_batch
from solver.instrument.arrays import Floats, Grey
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.instrument.observation import ImageFrame
from solver.lab.table import csv_text, row
from solver.methods import Method
from solver.tracker import PushTracker

Record = dict[str, Any]
# Gathers measurements and returns a function that solves them all at once.
Batch = Callable[[Sequence[Measurement]], Callable[[], object]]


def _gathered(measurements: Sequence[Measurement]) -> Callable[[], object]:
    counts = [len(one.points) for one in measurements]
    return partial(
        exact_fit_batch,
        np.vstack([one.points for one in measurements]),
        np.vstack([one.sigma_vectors for one in measurements]),
        np.cumsum([0, *counts]),
        measurements[0].base_covariance,
        measurements[0].rig.beam,
    )


# Methods that can solve many frames in one call.
BATCHES: Final[dict[str, Batch]] = {"exact_fit": _gathered}


class _Watch:
    """Wrapper of a method that records its last measurement and its time [s]."""

    def __init__(self, method: Method) -> None:
        self._method = method
        self.measurement: Measurement | None = None
        self.seconds = 0.0

    def forget(self) -> None:
        """Reset the record before a frame, which may not reach the method."""
        self.measurement, self.seconds = None, 0.0

    def __call__(self, measurement: Measurement) -> Estimate:
        self.measurement = measurement
        began = time.perf_counter()
        try:
            return self._method(measurement)
        finally:
            self.seconds = time.perf_counter() - began


class Run:
    """Rounds of one method over the same frames; the first round is a warm-up."""

    def __init__(self, method: Method, batch: Batch | None, antenna: Antenna, frames: int) -> None:
        self._method, self._antenna = method, antenna
        self._answers: list[Estimate] = []
        self._images: list[Floats] = []
        self._within: list[Floats] = []
        self._points: list[Floats] = []
        self._batches: list[float] = []
        self._frames = frames
        self._batch = batch

    def once(self, frames: Sequence[ImageFrame], images: Sequence[Grey]) -> None:
        """Solve every frame once from its image, and once from its points."""
        watch = _Watch(self._method)
        push = PushTracker(self._antenna, watch)
        image, within, points = (np.full(self._frames, np.nan) for _ in range(3))
        self._answers, measurements = [], list[Measurement]()
        for i, (frame, pixels) in enumerate(zip(frames, images, strict=True)):
            watch.forget()
            solved = push.solve(pixels, frame.readings, frame.push_id)
            image[i], within[i] = solved.seconds, watch.seconds
            if watch.measurement is not None:
                points[i] = _seconds(partial(self._method, watch.measurement))
                measurements.append(watch.measurement)
            self._answers.append(solved.estimate)
        self._images.append(image)
        self._within.append(within)
        self._points.append(points)
        if self._batch is not None and measurements:
            spent = _seconds(self._batch(measurements))
            self._batches.append(spent / len(measurements))

    @property
    def image_s(self) -> Floats:
        """Seconds of each frame from image to estimate (n,)."""
        return _typical(self._images)

    @property
    def method_s(self) -> Floats:
        """Seconds of each frame in the method itself (n,)."""
        return _typical(self._within)

    def record(self, frames: Sequence[ImageFrame]) -> Record:
        """Convert times and estimates to a record."""
        points = _typical(self._points)
        rows = [
            row(frame.frame_id, answer, 1e3 * seconds)
            for frame, answer, seconds in zip(frames, self._answers, self.image_s, strict=True)
        ]
        return {
            "image_ms_per_frame": 1e3 * float(np.median(self.image_s)),
            "image_ms_p95": 1e3 * float(np.quantile(self.image_s, 0.95)),
            "points_us_per_frame": _microseconds(points),
            "points_us_per_frame_batched": _microseconds(self._batches[1:]),
            "predictions": csv_text(rows),
        }


def _typical(rounds: Sequence[Floats]) -> Floats:
    """Compute each frame's median over all rounds but the first, (n,)."""
    return np.asarray(np.median(rounds[1:] or rounds, axis=0))


def _microseconds(seconds: npt.ArrayLike) -> float | None:
    """Compute the median of the finite times in microseconds; return None if there are none."""
    known = np.asarray(seconds)[np.isfinite(seconds)]
    return 1e6 * float(np.median(known)) if len(known) else None


def _seconds(act: Callable[[], object]) -> float:
    """Time a call [s]; return NaN where it fails, which the table of estimates shows."""
    began = time.perf_counter()
    try:
        act()
    except Exception:  # noqa: BLE001 - a method may do anything
        return float("nan")
    return time.perf_counter() - began
