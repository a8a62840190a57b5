"""Run methods on datasets in worker processes, and continue after the loss of a worker.

The arguments of the process are FOLDER CENTRELINE REPEATS MEMORY_GB FRAME_S.

Each line on standard input is a JSON list of a method, a folder of observations, which is set up
once for consecutive methods, and the indices of the frames to solve, or null for all. For each
frame, one line of JSON is printed on standard output, the message `row` of a worker with its times;
or one line, `refused` for a rig that cannot be set up, `unusable` for a method that cannot be
found. A line `end` follows. When standard input ends, the parent process has ended or needs no
more: the workers are killed and FOLDER is removed.

No code of a user runs in this process, whose clocks measure the methods.
"""

import json
import multiprocessing
import os
import shutil
import signal
import socket
import statistics
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.context import ForkContext, SpawnContext
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.observation import Observations
from solver.lab.table import row
from solver.methods import METHODS
from vbaa_bench.scoring.isolation.connection import (
    MAX_TRACEBACK,
    TICK_S,
    Message,
    MessageError,
    Stamps,
    SupervisorEnd,
    checked_row,
    frame_of,
    is_text,
)
from vbaa_bench.scoring.isolation.method_sources import SOURCES
from vbaa_bench.scoring.isolation.process_tree import (
    adopt_orphans,
    end_descendants,
    largest_memory,
    processor_seconds,
)
from vbaa_bench.scoring.isolation.reference_kernel import PROCESSOR_COLUMN, REFERENCE_COLUMN
from vbaa_bench.scoring.isolation.worker import EMPTY_RUNS, GIGABYTE, Task, opened, work

# Time limit for the start of a worker, compilation included [s]. Chosen: a first compilation of
# the solver took 110 s on a loaded machine.
MAX_START_S: Final = 300.0
# Number of consecutive losses after which the method is given up. Chosen: an endless loop ends
# after three minutes, and a method that fails in one configuration out of many continues.
MAX_CONSECUTIVE_LOSSES: Final = 3
# Time in which a process that has closed its connection ends [s]. Chosen: a thousand times more
# than it takes.
_MAX_EXIT_S: Final = 1.0

# A forked worker inherits the calibration; forking is safe on Linux only.
_CONTEXT: Final[ForkContext | SpawnContext] = (
    multiprocessing.get_context("fork")
    if sys.platform == "linux"
    else multiprocessing.get_context("spawn")
)


class _WorkerLostError(Exception):
    """Error for a worker that died, timed out or broke a rule; its text is the reason."""


class _Times(NamedTuple):
    """Time by the supervisor's clock [s], and the worker's processor time, if it is known [s]."""

    seconds: float
    processor_seconds: float | None


class _Worker:
    """Process that solves frames, and the connection for its messages.

    All methods that wait for the process raise _WorkerLostError.
    """

    def __init__(self, task: Task, *job: Any) -> None:
        self._task = task
        ours, its = socket.socketpair()
        self._stamps = Stamps()
        self._process = _CONTEXT.Process(target=work, args=(task, *job, its, self._stamps.sender))
        self._process.start()
        its.close()
        self._messages = SupervisorEnd(ours, self._has_ended)
        # Limit of the import and of the warm-up. Our own methods may have to be compiled, or learn.
        self._first_limit_s = MAX_START_S if task.method in METHODS else task.frame_s
        # What measuring adds to a time.
        self._added = _Times(0.0, None)
        self._checked_memory = 0.0

    def load(self) -> Message:
        """Wait until the method is imported.

        Return a message with the reason why it is `unusable`; else an empty one.
        """
        with _lost_after(MAX_START_S, self._process) as deadline:
            self._added = self._added_by_measuring(deadline)
            self._messages.receive(deadline, "importing")
        with _lost_after(self._first_limit_s, self._process) as deadline:
            message = self._messages.receive(deadline, "imported", "unusable")
            if message["kind"] == "imported":
                return {}
            if not is_text(message.get("reason"), 2 * MAX_TRACEBACK):
                raise MessageError("without a reason")
            return {message["kind"]: message["reason"]}

    def warm_up(self) -> None:
        """Wait for the end of the warm-up."""
        with _lost_after(self._first_limit_s, self._process) as deadline:
            self._messages.receive(deadline, "ready")

    def begin(self, remaining: set[int]) -> int:
        """Wait until the worker begins one of the remaining frames; return its index."""
        self._check_memory()
        with _lost_after(MAX_START_S, self._process) as deadline:
            return frame_of(self._messages.receive(deadline, "begin"), remaining)

    def solved(self, index: int, frame_id: str) -> Message:
        """Wait for the row of a frame, and add its times."""
        times = defaultdict[str, list[_Times]](list)
        with _lost_after(self._task.frame_s, self._process) as deadline:
            while (message := self._messages.receive(deadline, "start", "row"))["kind"] == "start":
                times[str(message.get("what"))].append(self._measure(deadline))
            checked_row(message, index, frame_id)
            frame, reference = times.pop("frame", []), times.pop("reference", [])
            # An image that cannot be read is not solved.
            unread = not frame and message["row"]["outcome"] == Outcome.INVALID
            if times or len(reference) != 1 or not (unread or len(frame) == self._task.repeats):
                raise MessageError("out of turn")
        seconds = [run.seconds for run in frame] or [self._added.seconds]
        message["row"] |= {
            "image_ms": 1e3 * max(statistics.median(seconds) - self._added.seconds, 0.0),
            PROCESSOR_COLUMN: self._least_processor_ms(frame),
            REFERENCE_COLUMN: self._least_processor_ms(reference),
        }
        return message

    def kill(self) -> None:
        """Kill the process and all processes that it has started."""
        if self._process.pid is not None and hasattr(os, "killpg"):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        end_descendants()
        self._messages.close()
        self._stamps.close()

    def _measure(self, deadline: float) -> _Times:
        """Measure what the worker computes between two messages. Raises as `receive` does."""
        assert self._process.pid is not None
        processor_start, start = processor_seconds(self._process.pid), time.perf_counter()
        self._messages.answer()
        self._messages.receive(deadline, "stop")
        seconds, processor_end = time.perf_counter() - start, processor_seconds(self._process.pid)
        if stamps := self._stamps.read():
            if len(stamps) != 2:
                raise MessageError("out of turn")
            seconds = 1e-9 * (stamps[1] - stamps[0])
        self._messages.answer()
        if processor_start is None or processor_end is None:
            return _Times(seconds, None)
        return _Times(seconds, processor_end - processor_start)

    def _added_by_measuring(self, deadline: float) -> _Times:
        """Measure an empty method, whose time is known, before any code of the user runs."""
        added, processor_added = list[float](), list[float]()
        for _ in range(EMPTY_RUNS):
            self._messages.receive(deadline, "start")
            measured = self._measure(deadline)
            own = self._messages.receive(deadline, "empty")
            added.append(measured.seconds - own["seconds"])
            if measured.processor_seconds is not None:
                processor_added.append(measured.processor_seconds - own["processor_seconds"])
        processor = statistics.median(processor_added) if processor_added else None
        return _Times(statistics.median(added), processor)

    def _least_processor_ms(self, runs: Sequence[_Times]) -> float | None:
        """Return the least processor time of several runs; None if it is not known.

        Other programs only lengthen it: the shortest is the least disturbed.
        """
        known = [run.processor_seconds for run in runs if run.processor_seconds is not None]
        if not known or self._added.processor_seconds is None:
            return None
        return 1e3 * max(min(known) - self._added.processor_seconds, 0.0) or None

    def _has_ended(self) -> bool:
        self._check_memory()
        return not self._process.is_alive()

    def _check_memory(self) -> None:
        """Raise _WorkerLostError if a process of the method uses too much memory."""
        limit, now = self._task.memory_gb, time.monotonic()
        if not limit or now < self._checked_memory + TICK_S:
            return
        self._checked_memory = now
        if largest_memory() > limit * GIGABYTE:
            raise _WorkerLostError(
                f"the method needs more than {limit:g} GB, the limit of --memory"
            )


@contextmanager
def _lost_after(limit_s: float, process: Any) -> Iterator[float]:
    """Provide a deadline; convert what a worker does wrong within the block to a reason."""
    try:
        yield time.monotonic() + limit_s
    except TimeoutError as error:
        raise _WorkerLostError(f"timed out: no answer within {limit_s:g} s") from error
    except EOFError as error:
        process.join(_MAX_EXIT_S)
        if process.is_alive():
            raise _WorkerLostError("the method's process closed its connection") from error
        raise _WorkerLostError(f"the method's process died: {_end(process.exitcode)}") from error
    except MessageError as error:
        raise _WorkerLostError(f"the method's process sent a message {error}") from error


class _Workers:
    """At most one worker at a time, and none after the parent process has ended."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._lock = folder, threading.Lock()
        self._worker: _Worker | None = None

    @contextmanager
    def one(self, *job: Any) -> Iterator[_Worker]:
        """Start a worker; kill it at the end with all processes that it has started."""
        with self._lock:
            self._worker = _Worker(*job)
        try:
            yield self._worker
        finally:
            self._worker.kill()

    def exit_with_parent(self, requests: "SimpleQueue[str]") -> None:
        """Pass on the lines of standard input; when it ends, kill the worker and exit.

        The folder is removed.
        """
        text = b""
        # Not sys.stdin: a forked worker closes it, and would wait for its lock forever.
        while received := os.read(0, 4096):
            *lines, text = (text + received).split(b"\n")
            for line in lines:
                requests.put(line.decode())
        with self._lock:  # never released, so that no other worker is started
            if self._worker is not None:
                self._worker.kill()
            shutil.rmtree(self._folder, ignore_errors=True)
            os._exit(1)


def supervise(
    task: Task, observations: Observations, workers: _Workers, chosen: Sequence[int] | None = None
) -> Iterator[Message]:
    """Solve the chosen frames, by default all; yield an estimate or a reason of loss for each."""
    frames = observations.frames
    outcomes: dict[int, Outcome] = {}  # frames with a message from a worker
    remaining = set(range(len(frames)) if chosen is None else chosen)
    push, reason, losses, warm = "", "", 0, True
    while remaining:
        # The push in which a worker was lost is replayed from its start.
        replayed = {i: outcome for i, outcome in outcomes.items() if frames[i].push_id == push}
        indices = sorted(remaining | replayed.keys())
        current: int | None = None
        started = False
        with workers.one(task, indices, replayed, warm) as worker:
            try:
                if refusal := worker.load():
                    yield refusal
                    return
                if warm:
                    worker.warm_up()
                while remaining:
                    current = worker.begin(remaining)
                    started = True
                    message = worker.solved(current, frames[current].frame_id)
                    outcomes[current] = Outcome(message["row"]["outcome"])
                    remaining.discard(current)
                    current, losses = None, 0
                    yield message
            except _WorkerLostError as error:
                reason = str(error)
        if not remaining:
            return
        if current is not None:
            yield _lost(frames[current].frame_id, current, reason)
            remaining.discard(current)
            push = frames[current].push_id
        losses += 1
        # The warm-up itself may have failed: it counts as a loss, and is not repeated.
        if losses == MAX_CONSECUTIVE_LOSSES or not (started or warm):
            cause = f"{losses} losses in a row" if started else "it cannot be started"
            for index in sorted(remaining):
                yield _lost(frames[index].frame_id, index, f"not tried, {cause}; last {reason}")
            return
        warm = warm and started


def _lost(frame_id: str, index: int, reason: str) -> Message:
    return {"index": index, "row": row(frame_id, Estimate(Outcome.CRASHED, reason), None)}


def _end(status: int | None) -> str:
    """Describe how a process ended."""
    if status is None or status >= 0:
        return f"exit status {status}"
    name = signal.Signals(-status).name
    hint = ", as sent by the system when memory runs out" if name == "SIGKILL" else ""
    return f"signal {name}{hint}"


def main() -> None:
    """Run each method that standard input names on the folder that is named with it."""
    folder, centreline, repeats, memory_gb, frame_s = sys.argv[1:]
    adopt_orphans()
    workers, requests = _Workers(Path(folder)), SimpleQueue[str]()
    threading.Thread(target=workers.exit_with_parent, args=(requests,), daemon=True).start()
    while True:
        method, path, chosen = json.loads(requests.get())
        observations = Path(path)
        limits = int(repeats), float(memory_gb), float(frame_s)
        task = Task(observations, method, Path(folder, SOURCES), centreline, *limits)
        try:
            opened_observations, _ = opened(observations, centreline)
            for message in supervise(task, opened_observations, workers, chosen):
                print(json.dumps(message), flush=True)
        except InputError as error:
            print(json.dumps({"refused": str(error)}), flush=True)
        print(json.dumps({"end": path}), flush=True)
