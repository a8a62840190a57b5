"""Estimation from shots as they arrive, and its output as JSON."""

import copy
import json
import statistics
import time
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace

import numpy as np

from solver.antenna import Antenna
from solver.first_start import touched_in_the_middle, with_outliers, with_shared_errors
from solver.instrument.arrays import Grey
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import View
from solver.lab.shots import Shot, Source
from solver.lab.table import Row, row
from solver.methods import Method
from solver.to_measurement import to_measurement
from solver.tracker import (
    FrameSolution,
    PushTracker,
    extract_centreline,
    run_method,
)

_ROTATION = 0.05  # [rad]


@dataclass(frozen=True)
class FrameResult:
    """Answer for one frame: the shot, its solution, its row of the table and its latency [s].

    The solution's processor time is the least of all repeats. The latency is the time from the
    image in memory to the estimate. It includes the time that a camera's frame has waited.
    """

    shot: Shot
    solved: FrameSolution
    row: Row
    latency: float


def solve_shots(
    source: Source,
    antenna: Antenna,
    method: Method,
    repeats: int = 1,
    measured: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> Generator[FrameResult]:
    """Solve each shot with the previous frames of its push, `repeats` times for a median time.

    An image that cannot be used also gives an answer, with the outcome "invalid". Each solution is
    computed within a context `measured()`, for clocks other than those of this process.
    """
    tracker = PushTracker(antenna, method)
    for shot in source:
        wait = time.perf_counter() - shot.taken
        if shot.image is None:
            failed = FrameSolution(Estimate(Outcome.INVALID, shot.fault), None, 0.0, 0.0)
            yield FrameResult(shot, failed, row(shot.name, failed.estimate, 0.0), wait)
            continue
        # Each repeat uses a copy; otherwise the frame would be among its own previous frames.
        shared = {id(part): part for part in (antenna, method)}
        copies = [copy.deepcopy(tracker, dict(shared)) for _ in range(repeats - 1)]
        runs = list[FrameSolution]()
        for runner in (*copies, tracker):
            with measured():
                runs.append(runner.solve(shot.image, shot.readings, shot.push_id))
        seconds = statistics.median(run.seconds for run in runs)
        # Other programs only lengthen it: the shortest is the least disturbed.
        least = min(run.processor_seconds for run in runs)
        solved = replace(runs[-1], processor_seconds=least)
        yield FrameResult(
            shot, solved, row(shot.name, solved.estimate, 1e3 * seconds), wait + seconds
        )


def warm_up(antenna: Antenna, method: Method, rest_image: Grey) -> None:
    """Run a method on synthetic inputs, so that no frame has to wait for numba's compilation.

    The beam at rest is bent artificially, its tip by 3 % of the length, as if touched in the
    middle. Inputs include a blank image and outliers, because numba compiles anew for other
    array layouts: those of an image without any candidate, and those of the points left after some
    are rejected. Points whose neighbours err alike need the fit of another beam.
    """
    extract_centreline(antenna, np.full_like(rest_image, np.median(rest_image)))
    at_rest = to_measurement(antenna, extract_centreline(antenna, rest_image))
    view = at_rest.view
    bent = touched_in_the_middle(view.points, at_rest.rig.beam.length)
    clean = View(bent, view.sigma_vectors, view.viewpoint)
    for points in (
        bent,
        with_outliers(bent, view.sigma_vectors),
        with_shared_errors(bent, view.sigma_vectors),
    ):
        tipless = View(points, view.sigma_vectors, view.viewpoint)
        run_method(method, replace(at_rest, view=tipless))
    # A push of two frames; the motor's rotation is of the order of the slope of the bent beam.
    first = replace(at_rest, view=clean, motor_angle=_ROTATION / 2)
    run_method(method, replace(first, motor_angle=_ROTATION, earlier=(first,)))


def json_line(given: FrameResult) -> str:
    """Format one frame's answer as one line of JSON, with units in the names."""
    metadata: Row = {
        "frame": given.shot.number,
        "name": given.shot.name,
        "time_s": given.shot.seconds,
        "latency_ms": 1e3 * given.latency,
        "skipped": given.shot.skipped,
    }
    values = {key: value for key, value in given.row.items() if value is not None}
    values.pop("frame_id")
    return json.dumps({**metadata, **values})
