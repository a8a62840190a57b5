"""Workers of a Dask cluster, in the place of a pool of processes of this machine.

Workers write to a folder that all machines share; the scheduler carries jobs and their small
results only. Lost workers and a restarted scheduler cost time, but no data: a job may be run twice.
"""

import contextlib
import functools
import hashlib
import json
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Self

from solver.instrument.errors import InputError
from vbaa_bench.dataset.code import code_digests
from vbaa_bench.dataset.manifest import versions
from vbaa_bench.generation.cluster_address import ClusterAddress
from vbaa_bench.generation.job import Ended, Job, WorkerDiedError

# Jobs at the scheduler at a time. Chosen: enough for hundreds of workers, and little to submit
# again when the scheduler restarts.
OUTSTANDING: Final = 1000
# Seconds after which a scheduler that does not answer is given up. Chosen: time to restart it.
PATIENCE_S: Final = 600.0
_POLL_S: Final = 0.1


class _Counted(NamedTuple):
    """Result of a job and the number of its pieces."""

    result: Any
    pieces: int


class ClusterPool:
    """Processes of a Dask cluster, each holding `build(*arguments)`; see Pool."""

    def __init__(
        self,
        address: ClusterAddress,
        build: Callable[..., Any],
        arguments: tuple[Any, ...],
        remark: Callable[[str], None],
    ) -> None:
        self._address, self._remark = address, remark
        self._build, self._arguments = build, arguments
        self._program = _program()
        self._clients = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._client = self._connected()
        return self

    def __exit__(self, *_: object) -> None:
        self._clients.close()  # jobs that have not begun are dropped by the scheduler

    def outcomes(self, jobs: deque[Job], done: Callable[[int], None]) -> Iterator[Ended]:
        """Take jobs from the left, run them, and yield each when it has ended, by death or not.

        Jobs may be added meanwhile. Raises what a method raises, and InputError if a worker has
        another version of the program or packages, or the scheduler does not answer for
        PATIENCE_S.
        """
        from distributed.scheduler import KilledWorker

        pending, pieces = dict[Any, Job](), 0
        while jobs or pending:
            self._stay_connected()
            while jobs and len(pending) < OUTSTANDING:
                job = jobs.popleft()
                pending[self._submitted(job)] = job
            ready = [future for future in pending if future.status != "pending"]
            for future in ready:
                job = pending.pop(future)
                if future.status == "lost":
                    jobs.append(job)
                    continue
                # A finished result may be lost with its worker until it is here: Dask then runs
                # the job again, which may kill the next worker, or end with the scheduler.
                try:
                    counted: _Counted = future.result()
                except KilledWorker:
                    yield Ended(job, None, WorkerDiedError())
                except CancelledError:
                    jobs.append(job)
                else:
                    pieces += counted.pieces
                    yield Ended(job, counted.result)
            done(pieces)
            if not ready:
                time.sleep(_POLL_S)

    def _submitted(self, job: Job) -> Any:
        return self._client.submit(
            run_job, self._program, self._build, self._arguments, job, pure=False
        )

    def _connected(self) -> Any:
        """Connect to the scheduler, and wait for it if it is not there yet. Raises InputError."""
        from distributed import Client

        end, waits = time.monotonic() + PATIENCE_S, False
        where = self._clients.enter_context(self._address.scheduler())
        while True:
            try:
                client = Client(where, set_as_default=False)
                return self._clients.enter_context(client)
            except (OSError, TimeoutError) as error:
                if time.monotonic() > end:
                    raise InputError(f"--dask {self._address}: no scheduler answers") from error
            if not waits:
                self._remark(f"waiting for the scheduler at {self._address}")
                waits = True
            time.sleep(1)

    def _stay_connected(self) -> None:
        """Connect again if the client has given up."""
        if self._client.status == "closed":
            self._clients.close()
            self._client = self._connected()


# Dask may run tasks in several threads. A renderer is used in the one thread that has built it.
@functools.cache
def _thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "vbaa-bench")


@dataclass
class _Resident:
    """This worker's object, and what it was built from."""

    key: Any = None
    built: Any = None


_RESIDENT: Final = _Resident()


def run_job(
    program: str, build: Callable[..., Any], arguments: tuple[Any, ...], job: Job
) -> _Counted:
    """Run a job in a worker of a cluster; its object is built for the first job.

    `program` identifies the version of the program that has submitted the job. Raises what the job
    raises, and InputError if this worker has another version.
    """
    return _thread().submit(_run, program, build, arguments, job).result()


def _run(program: str, build: Callable[..., Any], arguments: tuple[Any, ...], job: Job) -> _Counted:
    pieces = 0

    def piece_done() -> None:
        nonlocal pieces
        pieces += 1

    key = program, build, arguments
    if _RESIDENT.key != key:
        if program != _program():
            raise InputError(
                f"worker on {socket.gethostname()}: has another version of the program or of its "
                "packages, allowed is the version that submits the jobs"
            )
        _RESIDENT.key = _RESIDENT.built = None
        try:
            _RESIDENT.built = build(*arguments)
            _RESIDENT.key = key
        except InputError as error:
            raise InputError(f"worker on {socket.gethostname()}: {error}") from error
    return _Counted(getattr(_RESIDENT.built, job.method)(piece_done, *job.arguments), pieces)


@functools.cache
def _program() -> str:
    """Compute a digest of the code and of the versions of packages that decide the data."""
    record = json.dumps([versions(), code_digests()], sort_keys=True)
    return hashlib.sha256(record.encode()).hexdigest()
