"""Run methods on datasets in worker processes, and continue after the loss of a worker.

The arguments of the process are FOLDER CENTRELINE REPEATS MEMORY_GB FRAME_S.

Each line on standard input is a JSON list of a method, a folder of observations, which is set up
once for consecutive methods, and the indices of the frames to solve, or null for all. For each
frame, one line of JSON is printed on standard output, the message `row` of a worker; or one line,
`refused` for a rig that cannot be set up, `unusable` for a method that cannot be found. A line
`end` follows. When standard input ends, the parent process has ended or needs no
more: the workers are killed and FOLDER is removed.
"""

import json
import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.context import ForkContext, SpawnContext
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.observation import Observations
from solver.lab.table import row
from solver.methods.by_name import find_method
from vbaa_bench.scoring.worker import Task, opened, work

# Time limit for the start of a worker, compilation included [s]. Chosen: a first compilation of
# the solver took 110 s on a loaded machine.
MAX_START_S: Final = 300.0
# Number of consecutive losses after which the method is given up. Chosen: an endless loop ends
# after three minutes, and a method that fails in one configuration out of many continues.
MAX_CONSECUTIVE_LOSSES: Final = 3
# Interval at which a worker's death is checked [s].
_TICK_S: Final = 0.05

Message = dict[str, Any]

# A forked worker inherits the calibration; forking is safe on Linux only.
_CONTEXT: Final[ForkContext | SpawnContext] = (
    multiprocessing.get_context("fork")
    if sys.platform == "linux"
    else multiprocessing.get_context("spawn")
)


class _WorkerLostError(Exception):
    """Error for a worker that died or timed out; its text is the reason."""


class _Worker:
    """Process that solves frames, and the connection for its messages."""

    def __init__(self, *job: Any) -> None:
        self._receiver, sender = _CONTEXT.Pipe(duplex=False)
        self._process = _CONTEXT.Process(target=work, args=(*job, sender))
        self._process.start()
        sender.close()

    def receive(self, limit_s: float) -> Message:
        """Wait for the next message. Raises _WorkerLostError."""
        deadline = time.monotonic() + limit_s
        while time.monotonic() < deadline:
            alive = self._process.is_alive()
            # Poll once more after its death: the last message may have arrived just before.
            if self._receiver.poll(_TICK_S if alive else 0):
                try:
                    message: Message = json.loads(self._receiver.recv_bytes())
                except (EOFError, OSError, ValueError):
                    self._process.join(_TICK_S)
                else:
                    return message
            if not alive:
                raise _WorkerLostError(f"the method's process died: {_end(self._process.exitcode)}")
        raise _WorkerLostError(f"timed out: no answer within {limit_s:g} s")

    def kill(self) -> None:
        """Kill the process and all processes that it has started."""
        if self._process.pid is not None and hasattr(os, "killpg"):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()


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
        with workers.one(task, indices, replayed, warm) as worker:
            try:
                message = worker.receive(MAX_START_S)
                if "refused" in message or "unusable" in message:
                    yield message
                    return
                while remaining:
                    message = worker.receive(MAX_START_S if current is None else task.frame_s)
                    if "begin" in message:
                        current = message["begin"]
                    else:
                        index = message["index"]
                        outcomes[index] = Outcome(message["row"]["outcome"])
                        remaining.discard(index)
                        current, losses = index, 0
                        yield message
            except _WorkerLostError as error:
                reason = str(error)
        if not remaining:
            return
        started = current is not None
        if current is not None and current in remaining:
            yield _lost(frames[current].frame_id, current, reason)
            remaining.discard(current)
            push = frames[current].push_id
            losses += 1
        if losses == MAX_CONSECUTIVE_LOSSES or not (started or warm):
            cause = f"{losses} frames in a row were lost" if started else "it cannot be started"
            for index in sorted(remaining):
                yield _lost(frames[index].frame_id, index, f"not tried, {cause}; last {reason}")
            return
        # The warm-up itself may have failed: try once more without it.
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
    workers, requests = _Workers(Path(folder)), SimpleQueue[str]()
    threading.Thread(target=workers.exit_with_parent, args=(requests,), daemon=True).start()
    while True:
        method, path, chosen = json.loads(requests.get())
        observations = Path(path)
        task = Task(
            observations, method, centreline, int(repeats), float(memory_gb), float(frame_s)
        )
        try:
            if ":" not in method:
                find_method(method)  # a misspelled name is found before the rig is set up
        except InputError as error:
            print(json.dumps({"unusable": str(error)}), flush=True)
            print(json.dumps({"end": path}), flush=True)
            continue
        try:
            opened_observations, _ = opened(observations, centreline)
            for message in supervise(task, opened_observations, workers, chosen):
                print(json.dumps(message), flush=True)
        except InputError as error:
            print(json.dumps({"refused": str(error)}), flush=True)
        print(json.dumps({"end": path}), flush=True)
