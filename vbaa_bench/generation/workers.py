"""Pool of worker processes, each with one object built once, whose methods are the jobs."""

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
    """A worker process ended by itself or was killed, for example for lack of memory."""

    def __str__(self) -> str:
        return "a worker process died; repeat the command to resume"


class WorkerStartError(WorkerDiedError):
    """A worker process could not build its object, for `reason`."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason

    def __str__(self) -> str:
        return f"a worker process could not start: {self.reason}"


class _InterruptedError(Exception):
    """The parent has been interrupted, so a worker's result is no longer needed."""


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

    The first argument of every method is a function to call after each finished piece. Processes
    are spawned, not forked: a renderer's threads do not survive a fork. They end when their parent
    ends, for whatever reason.
    """

    def __init__(self, count: int, build: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        context = multiprocessing.get_context("spawn")
        # SimpleQueue writes a piece before its job's result, so no piece is counted too late.
        self._pieces, self._stop = context.SimpleQueue(), context.Event()
        # Pickled here, so that a failed import in a worker can be reported.
        pickled = pickle.dumps((build, arguments))
        self._executor = ProcessPoolExecutor(
            count, context, _initialise, (pickled, self._pieces, self._stop)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # After an error or an interrupt no job starts, and a running job ends after its piece.
        if kind is not None:
            self._stop.set()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._pieces.close()

    def call(self, method: str, *arguments: Any) -> Any:
        """Run one job and return its result.

        Raises what the method raises, WorkerStartError or WorkerDiedError.
        """
        try:
            return self._submit(method, arguments).result()
        except BrokenProcessPool as error:
            raise WorkerDiedError from error

    def run(
        self, jobs: Sequence[tuple[str, tuple[Any, ...]]], done: Callable[[int], None]
    ) -> list[Any]:
        """Run all jobs and return their results. `done` gets the number of finished pieces.

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
                pieces += self._finished_pieces()
                done(pieces)
        except BrokenProcessPool as error:
            raise WorkerDiedError from error
        return [future.result() for future in futures]

    def _submit(self, method: str, arguments: tuple[Any, ...]) -> Future[Any]:
        with _interrupt_blocked(), _main_module_hidden():  # submitting starts processes
            return self._executor.submit(_work, method, arguments)

    def _finished_pieces(self) -> int:
        count = 0
        while not self._pieces.empty():
            count += self._pieces.get()
        return count


class SameProcess:
    """The interface of Pool for one object in this process."""

    def __init__(self, _count: int, build: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._object = build(*arguments)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def call(self, method: str, *arguments: Any) -> Any:
        """Run one job and return its result."""
        return getattr(self._object, method)(lambda: None, *arguments)

    def run(
        self, jobs: Sequence[tuple[str, tuple[Any, ...]]], done: Callable[[int], None]
    ) -> list[Any]:
        """Run all jobs and return their results. `done` gets the number of finished pieces."""
        pieces = 0

        def piece_done() -> None:
            nonlocal pieces
            pieces += 1
            done(pieces)

        return [getattr(self._object, method)(piece_done, *arguments) for method, arguments in jobs]


@contextlib.contextmanager
def _interrupt_blocked() -> Iterator[None]:
    """Block Ctrl-C, and deliver it afterwards to this process only.

    Child processes inherit the block. Otherwise each would end with a traceback during its imports.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextlib.contextmanager
def _main_module_hidden() -> Iterator[None]:
    """Prevent child processes from running the user's script again.

    Jobs do not need it. A script without `if __name__ == "__main__"` would start workers in each
    worker.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _initialise(pickled: bytes, pieces: Any, stop: Any) -> None:
    """Prepare a worker. An error in building its object is raised by its first job."""
    global _resident, _pieces, _stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _resident, _pieces, _stop = _build(pickled), pieces, stop


def _build(pickled: bytes) -> Any:
    """Build the worker's object, or return the error that prevents it."""
    try:
        build, arguments = pickle.loads(pickled)
        return build(*arguments)
    except Exception as error:  # noqa: BLE001  # any exception is the reason
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
