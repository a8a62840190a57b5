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
from solver.instrument.image_frame import ImageFrame
from solver.instrument.measurement import Measurement
from solver.lab.table import csv_text, row
from solver.methods import Method
from solver.tracker import PushTracker

Record = dict[str, Any]
# Takes measurements and returns a function that solves them all at once.
Batch = Callable[[Sequence[Measurement]], Callable[[], object]]


def _prepare_exact_fit(measurements: Sequence[Measurement]) -> Callable[[], object]:
    counts = [len(measurement.points) for measurement in measurements]
    return partial(
        exact_fit_batch,
        np.vstack([measurement.points for measurement in measurements]),
        np.vstack([measurement.sigma_vectors for measurement in measurements]),
        np.cumsum([0, *counts]),
        measurements[0].base_covariance,
        measurements[0].rig.beam,
    )


# Methods that can solve many frames in one call.
BATCHES: Final[dict[str, Batch]] = {"exact_fit": _prepare_exact_fit}


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

    def __init__(self, method: Method, batch: Batch | None, antenna: Antenna, frames: int) -> None:
        self._method, self._antenna = method, antenna
        self._estimates: list[Estimate] = []
        self._images: list[Floats] = []
        self._in_method: list[Floats] = []
        self._points: list[Floats] = []
        self._batches: list[float] = []
        self._frames = frames
        self._batch = batch

    def once(self, frames: Sequence[ImageFrame], images: Sequence[Grey]) -> None:
        """Solve every frame once from its image, and once from its points."""
        timed = _TimedMethod(self._method)
        tracker = PushTracker(self._antenna, timed)
        from_image, in_method, from_points = (np.full(self._frames, np.nan) for _ in range(3))
        self._estimates, measurements = [], list[Measurement]()
        for i, (frame, pixels) in enumerate(zip(frames, images, strict=True)):
            timed.reset()
            solved = tracker.solve(pixels, frame.readings, frame.push_id)
            from_image[i], in_method[i] = solved.seconds, timed.seconds
            if timed.measurement is not None:
                from_points[i] = _seconds(partial(self._method, timed.measurement))
                measurements.append(timed.measurement)
            self._estimates.append(solved.estimate)
        self._images.append(from_image)
        self._in_method.append(in_method)
        self._points.append(from_points)
        if self._batch is not None and measurements:
            elapsed = _seconds(self._batch(measurements))
            self._batches.append(elapsed / len(measurements))

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
            "points_us_per_frame_batched": _microseconds(self._batches[1:]),
            "predictions": csv_text(rows),
        }


def _typical(rounds: Sequence[Floats]) -> Floats:
    """Compute each frame's median over all rounds but the first, (n,)."""
    return np.asarray(np.median(rounds[1:] or rounds, axis=0))


def _microseconds(seconds: npt.ArrayLike) -> float | None:
    """Compute the median of the finite times in microseconds; return None if there are none."""
    finite = np.asarray(seconds)[np.isfinite(seconds)]
    return 1e6 * float(np.median(finite)) if len(finite) else None


def _seconds(call: Callable[[], object]) -> float:
    """Time a call [s]; return NaN where it fails, which the table of estimates shows."""
    start = time.perf_counter()
    try:
        call()
    except Exception:  # noqa: BLE001 - a method may raise any error
        return float("nan")
    return time.perf_counter() - start
