"""Workers of a Dask cluster, in the place of processes of this machine.

Workers write to a folder that all machines share; the scheduler carries jobs and their small
results only. Lost workers and a restarted scheduler cost time, but no data: a job may be run twice.
"""

import contextlib
import functools
import importlib
import pickle
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from solver.instrument.errors import InputError
from solver.instrument.safe_path import safe_path
from vbaa_bench.dataset.program import program_digest
from vbaa_bench.scene.user_modules import modules_in_use
from vbaa_bench.workers.jobs import Ended, Job, WorkerDiedError, Workers

# Classes of dask-jobqueue by the value of the key `cluster`.
CLUSTERS: Final = {
    "slurm": "SLURMCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "lsf": "LSFCluster",
    "oar": "OARCluster",
    "moab": "MoabCluster",
    "htcondor": "HTCondorCluster",
    "local": "LocalCluster",
}
# Chosen: a description has a dozen lines.
_MAX_BYTES: Final = 100_000
# Jobs at the scheduler at a time. Chosen: enough for hundreds of workers, and little to submit
# again when the scheduler restarts.
OUTSTANDING: Final = 1000
# Seconds after which a scheduler that does not answer is given up. Chosen: time to restart it.
PATIENCE_S: Final = 600.0
_POLL_S: Final = 0.1
# Seconds without a result after which it is said that there are no workers. Chosen.
REMARK_S: Final = 60.0


@dataclass(frozen=True)
class ClusterAddress:
    """The text of the option --dask: an address such as tcp://127.0.0.1:8786, or a YAML file."""

    text: str

    def __str__(self) -> str:
        """Return the text."""
        return self.text

    @classmethod
    def checked(cls, text: str) -> "ClusterAddress":
        """Check the text and, if it is a file, its content, before anything is started.

        Raises InputError, also if Dask is not installed.
        """
        try:
            import distributed  # noqa: F401

            if _is_file(text):
                import dask_jobqueue  # noqa: F401
        except ImportError as error:
            raise InputError(
                f"--dask {text}: {error.name} is not installed; install vbaa-bench[cluster]"
            ) from error
        if _is_file(text):
            _described(Path(text))
        elif "://" not in text:
            raise InputError(
                f"--dask is {text}, allowed is an address such as tcp://127.0.0.1:8786, or a "
                "file *.yaml that describes a cluster"
            )
        return cls(text)

    @contextlib.contextmanager
    def scheduler(self) -> Iterator[Any]:
        """Yield what a client connects to: the address, or a cluster that ends with the block."""
        if not _is_file(self.text):
            yield self.text
            return
        description = _described(Path(self.text))
        kind, jobs = description.pop("cluster"), description.pop("jobs")
        # Each kind has a module of its own.
        started = getattr(importlib.import_module(f"dask_jobqueue.{kind}"), CLUSTERS[kind])
        with contextlib.ExitStack() as stack:
            stack.enter_context(safe_path())  # whenever a job is started again, too
            try:
                cluster = stack.enter_context(started(**description))
            except (TypeError, ValueError, OSError) as error:
                raise InputError(f"{self.text}: no cluster can be started ({error})") from error
            cluster.scale(jobs=jobs)
            yield cluster


def _is_file(text: str) -> bool:
    return Path(text).suffix in {".yaml", ".yml"}


def _described(path: Path) -> dict[str, Any]:
    """Read the description of a cluster: `cluster`, `jobs`, and arguments of dask-jobqueue.

    Each process of a job has one thread. The scheduler listens on the loopback interface, unless
    the file states an `interface` or `scheduler_options`. Raises InputError.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(f"{path}: is larger than {_MAX_BYTES} bytes")
        document = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: is no mapping, allowed are the keys cluster, jobs and others")
    if document.get("cluster") not in CLUSTERS:
        raise InputError(
            f"{path}: cluster is {document.get('cluster')}, allowed is one of {', '.join(CLUSTERS)}"
        )
    jobs, cores = document.get("jobs"), document.get("cores", 1)
    for key, value in (("jobs", jobs), ("cores", cores)):
        if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= 100_000:
            raise InputError(f"{path}: {key} is {value}, allowed is a number from 1 to 100000")
    if not {"interface", "scheduler_options"} & document.keys():
        document["scheduler_options"] = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    return {"cores": cores, "processes": cores, **document}


class _Counted(NamedTuple):
    """Result of a job and the number of its pieces."""

    result: Any
    pieces: int


class ClusterPool(Workers):
    """Processes of a Dask cluster, each holding `build(*arguments)`."""

    def __init__(
        self,
        address: ClusterAddress,
        build: Callable[..., Any],
        arguments: tuple[Any, ...],
        remark: Callable[[str], None],
    ) -> None:
        self._address, self._remark = address, remark
        self._built = pickle.dumps((modules_in_use(), build, arguments))
        self._program = program_digest()
        self._clients = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._client = self._connected()
        return self

    def __exit__(self, *_: object) -> None:
        self._clients.close()  # jobs that have not begun are dropped by the scheduler

    def outcomes(self, jobs: deque[Job], done: Callable[[int], None]) -> Iterator[Ended]:
        """Run jobs and yield each when it has ended; see Workers.

        Raises what a method raises, and InputError if a worker has another version of the program
        or packages, or the scheduler does not answer for PATIENCE_S.
        """
        from distributed.scheduler import KilledWorker

        pending, pieces = dict[Any, Job](), 0
        ended = time.monotonic()  # of the last job, or of the last remark
        while jobs or pending:
            self._stay_connected()
            if time.monotonic() > ended + REMARK_S:
                self._remark_without_workers()
                ended = time.monotonic()
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
                    ended = time.monotonic()
                    yield Ended(job, counted.result)
            done(pieces)
            if not ready:
                time.sleep(_POLL_S)

    def _remark_without_workers(self) -> None:
        """Say it if the scheduler has no workers: a queue may start them in hours, or never."""
        with contextlib.suppress(OSError, TimeoutError):
            if not self._client.scheduler_info()["workers"]:
                self._remark(f"the scheduler at {self._address} has no workers; waiting for them")

    def _submitted(self, job: Job) -> Any:
        return self._client.submit(run_job, self._program, self._built, job, pure=False)

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

    key: tuple[str, bytes] | None = None
    built: Any = None


_RESIDENT: Final = _Resident()


def run_job(program: str, pickled: bytes, job: Job) -> _Counted:
    """Run a job in a worker of a cluster; its object is built for the first job.

    `program` identifies the version of the program that has submitted the job. `pickled` are the
    users' modules in use, the function that builds the object, and its arguments. Raises what the
    job raises, and InputError if this worker has another version.
    """
    return _thread().submit(_run, program, pickled, job).result()


def _run(program: str, pickled: bytes, job: Job) -> _Counted:
    pieces = 0

    def piece_done() -> None:
        nonlocal pieces
        pieces += 1

    key = program, pickled
    if _RESIDENT.key != key:
        if program != program_digest():
            raise InputError(
                f"worker on {socket.gethostname()}: has another version of the program or of its "
                "packages, allowed is the version that submits the jobs"
            )
        _RESIDENT.key = _RESIDENT.built = None
        try:
            _, build, arguments = pickle.loads(pickled)
            _RESIDENT.built = build(*arguments)
            _RESIDENT.key = key
        except InputError as error:
            raise InputError(f"worker on {socket.gethostname()}: {error}") from error
    return _Counted(getattr(_RESIDENT.built, job.method)(piece_done, *job.arguments), pieces)
