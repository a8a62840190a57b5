"""A worker process: it builds one object, runs jobs on it, and ends with its parent."""

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
from typing import Any

from solver.instrument.quick_imports import quick_imports
from vbaa_bench.generation.job import Job, WorkerStartError


class _InterruptedError(BaseException):
    """The parent has been interrupted, so a worker's result is no longer needed."""


def serve(connection: Connection) -> None:
    """Run jobs in a worker until the parent has no more. An error in building ends the first."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def piece_done() -> None:
        connection.send((False, None))
        if connection.poll():  # the parent waits for the result, unless it ends this process
            raise _InterruptedError

    resident = _build(connection.recv_bytes())
    with contextlib.suppress(_InterruptedError):
        while (job := connection.recv()) is not None:
            connection.send((True, _result(resident, job, piece_done)))
    connection.close()


def _build(pickled: bytes) -> Any:
    """Build the worker's object, or return the error that prevents it."""
    try:
        with quick_imports():
            build, arguments = pickle.loads(pickled)
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
