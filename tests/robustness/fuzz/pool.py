"""A pool of long-lived child processes that run cases; a child that dies is replaced."""

import multiprocessing
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final

from solver.instrument.safe_path import safe_path
from tests.robustness.fuzz.case import (
    CLOCK_LIMIT_S,
    FINDINGS,
    MEMORY_LIMIT_MB,
    Case,
    KindFactory,
    Result,
)
from tests.robustness.fuzz.child import run_cases
from vbaa_bench.workers.resources import memory_mb

# Time [s] for a child to end itself at its limit, after which it is killed.
_GRACE_S: Final = 10.0
# Chosen: imports and compilation take 10 s; a machine may be loaded.
_START_S: Final = 300.0
# A child is replaced after this number of cases, since compiled libraries leak.
_CASES_PER_CHILD: Final = 2000


@dataclass
class _Child:
    process: BaseProcess
    pipe: Connection
    work: Path
    case: Case | None = None
    since: float = 0.0
    ready: bool = False
    finished: int = 0


def run_all(
    cases: Iterable[Case],
    factories: Mapping[str, KindFactory],
    seed: int,
    material: Path,
    work: Path,
    workers: int,
    keep: Callable[[Case, Path], None],
) -> Iterator[tuple[Case, Result]]:
    """Run cases in `workers` children; yield each with its result as it ends.

    `keep(case, folder)` is called with the input of each finding before it is deleted. Raises
    RuntimeError if a child cannot start.
    """
    remaining = iter(cases)
    started = 0
    children: list[_Child] = []

    def start() -> _Child:
        nonlocal started
        started += 1
        folder = work / f"child_{started:04d}"
        return _started(factories, seed, material, folder)

    try:
        children = [start() for _ in range(workers)]
        while children:
            ended = wait([child.pipe for child in children], timeout=1.0)
            for index, child in reversed(list(enumerate(children))):
                result, dead = _result(child, child.pipe in ended)
                if result is not None and child.case is not None:
                    if result.outcome in FINDINGS:
                        keep(child.case, child.work / "case")
                    yield child.case, result
                    child.case, child.finished = None, child.finished + 1
                    dead = dead or result.outcome in {"outside", "memory"}
                if dead and not child.ready:
                    raise RuntimeError("a child process of the fuzz could not start")
                if dead or child.finished >= _CASES_PER_CHILD:
                    _end(child)
                    child = children[index] = start()  # noqa: PLW2901
                if child.ready and child.case is None:
                    child.case = next(remaining, None)
                    if child.case is None:
                        _end(child)
                        del children[index]
                    else:
                        child.since = time.monotonic()
                        child.pipe.send(tuple(child.case))
    finally:
        for child in children:
            _end(child)


def _started(factories: Mapping[str, KindFactory], seed: int, material: Path, work: Path) -> _Child:
    context = multiprocessing.get_context("spawn")  # compiled libraries do not survive a fork
    here, there = context.Pipe()
    work.mkdir(parents=True)
    process = context.Process(
        target=run_cases, args=(there, dict(factories), seed, material, work), daemon=True
    )
    with safe_path():
        process.start()
    there.close()
    return _Child(process, here, work, since=time.monotonic())


def _result(child: _Child, readable: bool) -> tuple[Result | None, bool]:
    """Return the result of a child's case, if it has ended, and whether the child is dead."""
    seconds = time.monotonic() - child.since
    try:
        if readable:
            message = child.pipe.recv()
            if message == "ready":
                child.ready = True
                return None, False
            return message, False
    except (EOFError, OSError):
        child.process.join()
        code = child.process.exitcode
        late = seconds >= CLOCK_LIMIT_S
        text = f"ended with status {code} after {seconds:.1f} s\n{_last_output(child)}"
        return Result("hang" if late else "died", seconds, 0.0, text), True
    limit = CLOCK_LIMIT_S + _GRACE_S if child.ready else _START_S
    if (child.case is not None or not child.ready) and seconds > limit:
        child.process.kill()
        return Result("hang", seconds, 0.0, f"killed after {seconds:.0f} s"), True
    memory = memory_mb(child.process.pid or 0) if child.case is not None else 0.0
    if memory > MEMORY_LIMIT_MB * 2:
        child.process.kill()
        return Result("memory", seconds, memory, f"killed at {memory:.0f} MB"), True
    return None, False


def _last_output(child: _Child) -> str:
    """Return the end of what a child printed: where it was when its time was over."""
    try:
        return (child.work / "output").read_text(encoding="utf-8", errors="replace")[-3000:]
    except OSError:
        return ""


def _end(child: _Child) -> None:
    child.process.kill()
    child.process.join()
    child.pipe.close()
    shutil.rmtree(child.work, ignore_errors=True)
