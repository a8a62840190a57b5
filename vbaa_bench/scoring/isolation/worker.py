"""Worker process that solves frames with an untrusted method and may crash."""

import faulthandler
import functools
import os
import socket
import sys
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from solver.antenna import Antenna
from solver.centreline.extractors import EXTRACTORS
from solver.instrument.errors import InputError
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.observation import Observations, open_observations
from solver.lab.live import solve_shots, warm_up
from solver.lab.shots import Files, Shot
from solver.lab.table import Row
from solver.learning.frames import frames_to_learn, learn_from_frames, with_learned
from solver.methods import LEARNING, METHODS, Method
from solver.methods.by_name import find_method
from solver.methods.exact_fit_learned import exact_fit_stated
from solver.set_up import set_up
from vbaa_bench.scoring.information_sets import check_information
from vbaa_bench.scoring.isolation.connection import (
    MAX_MESSAGE,
    MAX_TRACEBACK,
    TEXTS,
    WorkerEnd,
    is_number_or_none,
)
from vbaa_bench.scoring.isolation.method_sources import import_from
from vbaa_bench.scoring.isolation.process_tree import end_with_parent
from vbaa_bench.scoring.isolation.reference_kernel import run_reference

GIGABYTE: Final = 1e9
# An empty method computes for so long [s], as the fastest methods do, and is run so often, for the
# median. Chosen: together 20 ms.
EMPTY_S: Final = 1e-3
EMPTY_RUNS: Final = 21
# Relative asymmetry, and the most negative eigenvalue of the correlations, that rounding explains.
# Measured: covariances of derived quantities are singular, with eigenvalues down to -1e-9.
_ROUNDING: Final = 1e-6


@dataclass(frozen=True)
class Task:
    """Task of a worker: observations, method, its sources, centreline, repeats and limits.

    `memory_gb` is the memory limit, 0 for none; `frame_s` is the time limit for a frame, repeats
    included, and for the warm-up.
    """

    observations: Path
    method: str
    sources: Path
    centreline: str
    repeats: int
    memory_gb: float
    frame_s: float


# Of one dataset at a time: the images of a collection would fill the memory.
@functools.lru_cache(maxsize=1)
def opened(observations: Path, centreline: str) -> tuple[Observations, Antenna]:
    """Open the observations and calibrate. A forked worker inherits the result."""
    opened_observations = open_observations(observations)
    return opened_observations, set_up(opened_observations, EXTRACTORS[centreline])


@functools.lru_cache(maxsize=1)
def learned_antenna(observations: Path, centreline: str) -> Antenna:
    """Return the antenna with the beam that its frames for learning show. Raises InputError."""
    frames, antenna = opened(observations, centreline)
    beam = learn_from_frames(antenna, frames_to_learn(frames.frames))
    return with_learned(antenna, beam)


def work(
    task: Task,
    indices: Sequence[int],
    replayed: Mapping[int, Outcome],
    warm: bool,
    connection: socket.socket,
    stamps: socket.socket | None,
) -> None:
    """Solve the frames at `indices`, and send one message for each step.

    Frames in `replayed` have been solved before: the method is not called for them; they only
    serve as previous frames of their push. Messages, by `kind`: `importing` before any code of the
    method runs, `imported`, and `ready` after a warm-up; for each other frame `begin`, and `row`
    with its `index`, the `traceback` if the method raised an error, the `faults` of its estimate,
    the `information` set that the method declares, and the `peak_mb` of memory; `unusable` for a
    method that cannot be found; `start` and `stop` around what the supervisor measures, to which it
    replies.
    """
    end_with_parent()
    if hasattr(os, "setsid"):
        os.setsid()  # processes started by the method are killed with this group
    os.dup2(2, 1)  # standard output is the supervisor's channel; prints go to standard error
    faulthandler.enable()
    supervisor = WorkerEnd(connection, stamps)
    observations, antenna = opened(task.observations, task.centreline)
    run_reference()  # compile it, or load its compiled code
    for _ in range(EMPTY_RUNS):
        with supervisor.timed("empty"):
            own = _empty_method()
        supervisor.send("empty", seconds=own[0], processor_seconds=own[1])
    supervisor.send("importing")
    if task.memory_gb:
        _limit_memory(task.memory_gb)
    try:
        import_from(task.sources)
        function = find_method(task.method)
        information = "" if task.method in METHODS else getattr(function, "information", "")
        if information:
            check_information(information, f"method '{task.method}'")
    except InputError as error:
        supervisor.send("unusable", reason=_reason(error))
        return
    if task.method in LEARNING:
        try:
            antenna = learned_antenna(task.observations, task.centreline)
        except InputError as error:
            function = exact_fit_stated(_reason(error))
    method = _MethodWrapper(function, task.memory_gb)
    supervisor.send("imported")
    if warm:
        warm_up(antenna, method, next(observations.read_rest_images()))
        supervisor.send("ready")

    class Resumed:
        """Source of the shots; it announces each shot to the method, replayed or not."""

        live, rate = False, Files.rate

        def __iter__(self) -> Iterator[Shot]:
            for shot in Files([observations.frames[index] for index in indices]):
                index = indices[shot.number]
                method.expect(replayed.get(index))
                if index not in replayed:
                    supervisor.send("begin", index=index)
                    # Print where a method hangs, just before it is killed.
                    faulthandler.dump_traceback_later(0.98 * task.frame_s)
                yield shot

    def measured() -> AbstractContextManager[None]:
        return nullcontext() if method.is_replaying else supervisor.timed("frame")

    for answer in solve_shots(Resumed(), antenna, method, task.repeats, measured):
        faulthandler.cancel_dump_traceback_later()
        index = indices[answer.shot.number]
        if index not in replayed:
            with supervisor.timed("reference"):
                run_reference()
            supervisor.send(
                "row",
                index=index,
                row=_sendable(answer.row),
                traceback=_utf8(method.traceback),
                faults=method.faults,
                information=information,
                peak_mb=_peak_mb(),
            )


def _reason(error: InputError) -> str:
    return _shortened(_utf8(str(error)), MAX_TRACEBACK)


def _empty_method() -> tuple[float, float]:
    """Compute for EMPTY_S; return the time that this took and its processor time [s]."""
    start, processor_start = time.perf_counter(), time.process_time()
    while time.perf_counter() < start + EMPTY_S:
        pass
    return time.perf_counter() - start, time.process_time() - processor_start


class _MethodWrapper:
    """Wrapper that stores the last traceback and faults of a method, and skips replayed frames."""

    def __init__(self, method: Method, memory_gb: float) -> None:
        self._method, self._memory_gb, self._process = method, memory_gb, os.getpid()
        self._replayed: Outcome | None = None
        self.traceback, self.faults = "", list[str]()

    @property
    def is_replaying(self) -> bool:
        """Whether the announced frame is a replayed one."""
        return self._replayed is not None

    def expect(self, replayed: Outcome | None) -> None:
        """Announce the next frame: a replayed one with this outcome, or None for a new one."""
        self._replayed, self.traceback, self.faults = replayed, "", []

    def __call__(self, measurement: Measurement) -> Estimate:
        if self._replayed is not None:
            # Only "no contact" ends a push; for later frames all other outcomes are equivalent.
            no_contact = self._replayed is Outcome.NO_CONTACT
            return Estimate(Outcome.NO_CONTACT if no_contact else Outcome.INVALID)
        try:
            estimate = self._method(measurement)
            self.faults = estimate_faults(estimate)
            return estimate
        except (Exception, SystemExit) as error:
            trace = error.__traceback__
            lines = traceback.format_exception(error.with_traceback(trace and trace.tb_next))
            self.traceback = _shortened("".join(lines), MAX_TRACEBACK)
            if isinstance(error, MemoryError) and self._memory_gb:
                limit = f"the method needs more than {self._memory_gb:g} GB, the limit of --memory"
                return Estimate(Outcome.CRASHED, f"MemoryError: {limit}")
            raise
        finally:
            if os.getpid() != self._process:  # a process forked by the method that returned
                os._exit(0)


def estimate_faults(estimate: object) -> list[str]:
    """List faults of an estimate's covariance as sentences; none for anything else.

    Sizes and values that are not finite are refused by `Estimate` itself.
    """
    if not isinstance(estimate, Estimate) or estimate.covariance is None:
        return []
    covariance = np.asarray(estimate.covariance)
    variances = np.diag(covariance)
    without = [
        name for name, variance in zip(estimate.values, variances, strict=True) if variance <= 0
    ]
    if without:
        return [f"the covariance has no positive variance for {', '.join(without)}"]
    sigmas = np.sqrt(variances)
    correlations = covariance / np.outer(sigmas, sigmas)
    if np.abs(correlations - correlations.T).max() > _ROUNDING:
        return ["the covariance is not symmetric"]
    if np.linalg.eigvalsh(correlations)[0] < -_ROUNDING * len(sigmas):
        return ["the covariance is not positive definite"]
    return []


def _sendable(row: Row) -> Row:
    """Convert a row to values that JSON and UTF-8 can represent, whatever the method returned.

    What should be a number and is none is None.
    """
    converted: Row = {}
    for name, value in row.items():
        if name == "assumption":
            converted[name] = value if value in list(Assumption) else None
        elif name in TEXTS:
            converted[name] = _shortened(_utf8(str(value)), MAX_MESSAGE)
        else:
            number = value.item() if isinstance(value, np.generic) else value
            converted[name] = number if is_number_or_none(number) else None
    return converted


def _utf8(text: str) -> str:
    """Replace characters that UTF-8 cannot represent."""
    return text.encode("utf-8", "replace").decode()


def _shortened(text: str, max_length: int) -> str:
    """Shorten a text to about `max_length` characters by leaving out its middle."""
    half = max_length // 2
    return text if len(text) <= max_length else f"{text[:half]} ... {text[-half:]}"


def _peak_mb() -> float | None:
    """Return the largest memory of this process so far [MB]; None on Windows."""
    if sys.platform == "win32":
        return None
    import resource

    # In bytes on macOS, in units of 1024 bytes elsewhere.
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def _limit_memory(gigabytes: float) -> None:
    """Limit the memory of this process, and of each that it starts; do nothing on Windows."""
    if sys.platform == "win32":
        return
    import resource

    # Limit data, not address space: compilers and GPU libraries reserve addresses they never use.
    size = int(gigabytes * GIGABYTE)
    resource.setrlimit(resource.RLIMIT_DATA, (size, size))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
