"""Worker processes, each with one object that is built once and whose methods are the jobs."""

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import sys
import threading
import types
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Any, Self

_resident: Any = None
_pieces: Any = None
_stop: Any = None


class WorkerDiedError(Exception):
    """A worker process ended by itself or was killed, out of memory perhaps."""

    def __str__(self) -> str:
        return "a worker process died; the same command goes on from what is finished"


class WorkerStartError(WorkerDiedError):
    """A worker process could not build its object; `reason` is why."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason

    def __str__(self) -> str:
        return f"a worker process could not start: {self.reason}"


class _InterruptedError(Exception):
    """The parent has been interrupted, so that what a worker makes is no longer wanted."""


def cores() -> int:
    """Count the processor cores that this process may use."""
    if hasattr(os, "process_cpu_count"):  # from Python 3.13
        return os.process_cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):  # not on Windows and macOS
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Pool:
    """`count` processes, each holding `build(*arguments)`; a job names a method and its arguments.

    Keep `arguments` to a few kilobytes: they are written to a starting process through a pipe,
    and if it dies before it has read them, a longer write never ends.

    Every method gets first a function to call when one more piece is done. Processes are
    spawned, not forked: a renderer's threads do not survive a fork. They end with their parent,
    however it ends.
    """

    def __init__(self, count: int, build: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        context = multiprocessing.get_context("spawn")
        # Simple: a piece is in the pipe before its job's result is, so none is counted too late.
        self._pieces, self._stop = context.SimpleQueue(), context.Event()
        # Pickled here, so that an import that fails in a worker can be reported.
        made = pickle.dumps((build, arguments))
        self._executor = ProcessPoolExecutor(
            count, context, _settle, (made, self._pieces, self._stop)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # After an error or an interrupt nothing new is begun, and what runs ends with its piece.
        if kind is not None:
            self._stop.set()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._pieces.close()

    def call(self, method: str, *arguments: Any) -> Any:
        """Run one job and await its result.

        Raises what the method raises, WorkerStartError or WorkerDiedError.
        """
        try:
            return self._submit(method, arguments).result()
        except BrokenProcessPool as error:
            raise WorkerDiedError from error

    def run(
        self, jobs: Sequence[tuple[str, tuple[Any, ...]]], done: Callable[[int], None]
    ) -> list[Any]:
        """Run all jobs; their results. `done` gets the number of finished pieces.

        Raises as `call` does.
        """
        pieces = 0
        try:
            futures = [self._submit(method, arguments) for method, arguments in jobs]
            pending = set(futures)
            done(pieces)
            while pending:
                finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                pieces += self._drained()
                done(pieces)
        except BrokenProcessPool as error:
            raise WorkerDiedError from error
        return [future.result() for future in futures]

    def _submit(self, method: str, arguments: tuple[Any, ...]) -> Future[Any]:
        with _interrupt_held_back(), _main_module_hidden():  # submitting starts processes
            return self._executor.submit(_work, method, arguments)

    def _drained(self) -> int:
        count = 0
        while not self._pieces.empty():
            count += self._pieces.get()
        return count


@contextlib.contextmanager
def _interrupt_held_back() -> Iterator[None]:
    """Deliver Ctrl-C afterwards, to this process alone: those that are started inherit the block.

    Otherwise it would end them with a traceback each, while they import.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _main_module_hidden() -> Iterator[None]:
    """Keep processes that are started from running the user's script again.

    Jobs need nothing of it. A script without `if __name__ == "__main__"` would start workers in
    each worker.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _settle(made: bytes, pieces: Any, stop: Any) -> None:
    """Prepare a worker. An error in building its object is raised by its first job."""
    global _resident, _pieces, _stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _resident, _pieces, _stop = _built(made), pieces, stop


def _built(made: bytes) -> Any:
    """The worker's object, or the error that it cannot be built for."""
    try:
        build, arguments = pickle.loads(made)
        return build(*arguments)
    except Exception as error:  # noqa: BLE001  # whatever it is, it is the reason
        return WorkerStartError(f"{type(error).__name__}: {error}")


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


def _piece_done() -> None:
    _pieces.put(1)
    if _stop.is_set():
        raise _InterruptedError


def _work(method: str, arguments: tuple[Any, ...]) -> Any:
    if isinstance(_resident, Exception):
        raise _resident
    return getattr(_resident, method)(_piece_done, *arguments)
