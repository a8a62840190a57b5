"""A worker process: it builds one object and runs jobs on it, until its memory has grown.

It ends with its parent.
"""

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from solver.instrument.quick_imports import quick_imports
from vbaa_bench.workers.jobs import Job, WorkerStartError
from vbaa_bench.workers.resources import own_memory_mb


class Message(NamedTuple):
    """What a worker sends when a piece of its job is finished, or the job itself has `ended`.

    `result` is that of the job, or the error in it. After the `last` one the process ends.
    """

    ended: bool
    result: Any = None
    last: bool = False


class _InterruptedError(BaseException):
    """The parent has been interrupted, so a worker's result is no longer needed."""


def serve(connection: Connection, growth_mb: float) -> None:
    """Run jobs in a worker until the parent has no more, or the worker has grown too much.

    The job after which resident memory is more than `growth_mb` above that after the first job is
    the last. An error in building ends the first job.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def piece_done() -> None:
        connection.send(Message(ended=False))
        if connection.poll():  # the parent waits for the result, unless it ends this process
            raise _InterruptedError

    resident = _build(connection.recv_bytes())
    first_mb, last = None, False
    with contextlib.suppress(_InterruptedError):
        while not last and (job := connection.recv()) is not None:
            result = _result(resident, job, piece_done)
            memory_mb = own_memory_mb()
            first_mb = memory_mb if first_mb is None else first_mb
            last = memory_mb - first_mb > growth_mb
            connection.send(Message(True, result, last))
    connection.close()


def _build(pickled: bytes) -> Any:
    """Build the worker's object, or return the error that prevents it."""
    try:
        with quick_imports():
            _, build, arguments = pickle.loads(pickled)
        return build(*arguments)
    except Exception as error:  # noqa: BLE001  # any exception is the reason
        return WorkerStartError(f"{type(error).__name__}: {error}")


def _result(resident: Any, job: Job, piece_done: Callable[[], None]) -> Any:
    if isinstance(resident, Exception):
        return resident
    try:
        return getattr(resident, job.method)(piece_done, *job.arguments)
    except Exception as error:  # noqa: BLE001  # raised again by the parent
        error.add_note(traceback.format_exc())
        return _picklable(error)


def _picklable(error: Exception) -> Exception:
    """Return an error, or one with its text if it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001  # whatever pickling raises
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
