"""Worker processes, each with one object that is built once and whose methods are the jobs."""

import multiprocessing
import queue
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Any, Self

_resident: Any = None
_ticks: Any = None


class WorkerDiedError(Exception):
    """A worker process ended by itself or was killed, out of memory perhaps."""

    def __str__(self) -> str:
        return "a worker process died; the same command goes on from what is finished"


class Pool:
    """`count` processes, each holding `build(*arguments)`; a job names a method and its arguments.

    Keep `arguments` to a few kilobytes: they are written to a starting process through a pipe,
    and if it dies before it has read them, a longer write never ends.

    Every method gets first a function to call when one more piece is done. Processes are
    spawned, not forked: a renderer's threads do not survive a fork.
    """

    def __init__(self, count: int, build: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        context = multiprocessing.get_context("spawn")
        self._ticks = context.Queue()
        self._executor = ProcessPoolExecutor(
            count, context, _settle, (build, arguments, self._ticks)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # After an error or an interrupt nothing new is begun; what runs is finished or discarded.
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._ticks.close()

    def call(self, method: str, *arguments: Any) -> Any:
        """One job, awaited. Raises what the method raises, or WorkerDiedError."""
        try:
            return self._submit(method, arguments).result()
        except BrokenProcessPool as error:
            raise WorkerDiedError from error

    def run(self, jobs: Sequence[tuple[str, tuple[Any, ...]]], done: Callable[[int], None]) -> None:
        """All jobs; `done(pieces)` is told how many pieces are finished. Raises as `call` does."""
        pieces = 0
        try:
            pending = {self._submit(method, arguments) for method, arguments in jobs}
            done(pieces)
            while pending:
                finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                pieces += self._drained()
                done(pieces)
        except BrokenProcessPool as error:
            raise WorkerDiedError from error

    def _submit(self, method: str, arguments: tuple[Any, ...]) -> Future[Any]:
        return self._executor.submit(_work, method, arguments)

    def _drained(self) -> int:
        count = 0
        while True:
            try:
                count += self._ticks.get_nowait()
            except queue.Empty:
                return count


def _settle(build: Callable[..., Any], arguments: tuple[Any, ...], ticks: Any) -> None:
    global _resident, _ticks
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    _resident, _ticks = build(*arguments), ticks


def _work(method: str, arguments: tuple[Any, ...]) -> Any:
    return getattr(_resident, method)(lambda: _ticks.put(1), *arguments)
