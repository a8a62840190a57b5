"""Worker processes of this machine."""

import contextlib
import multiprocessing
import multiprocessing.connection
import pickle
import signal
import sys
import time
import types
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import Any, Final

from solver.instrument.safe_path import safe_path
from vbaa_bench.scene.user_modules import modules_in_use
from vbaa_bench.workers.jobs import Ended, Job, WorkerDiedError, Workers
from vbaa_bench.workers.kernels import reference_kernels
from vbaa_bench.workers.worker_process import Message, serve

# Seconds between two looks at a pool without news, at which Ctrl-C is noticed on Windows. Chosen.
_POLL_S: Final = 0.2
# Seconds that a worker has to finish its piece after an error or an interrupt. Chosen: most frames
# take less. One that takes longer is lost, as are all of an unfinished shard.
GRACE_S: Final = 5.0
# Memory [MB] that a worker may gain after its first job; then a fresh process takes its place.
# Chosen: small random rigs leave 0.5 to 2 MB each in the allocators of C and Dr.Jit (measured),
# and a rig of another kind up to 130 MB at once, for which a process should not be replaced.
GROWTH_MB: Final = 200.0


@dataclass(eq=False)
class _Worker:
    """One process, the connection to it, its job if it has one, and the job's finished pieces.

    After the `last` job the process ends.
    """

    process: SpawnProcess
    connection: Connection
    job: Job | None = None
    pieces: int = 0
    last: bool = False

    @property
    def handles(self) -> tuple[Any, ...]:
        """What becomes ready when there is a message, or when the process has ended."""
        return self.connection, self.process.sentinel


class Pool(Workers):
    """`count` processes of this machine, each holding `build(*arguments)`.

    Processes are spawned, not forked: a renderer's threads do not survive a fork. They start with
    the first jobs, and end when their parent ends, for whatever reason. A process that dies takes
    only its own job with it, and another takes its place. One whose memory has grown by GROWTH_MB
    since its first job is replaced after its job.
    """

    def __init__(self, count: int, build: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._count, self._context = count, multiprocessing.get_context("spawn")
        # Pickled here, so that a failed import in a worker can be reported. Users' modules first:
        # the arguments may have kinds of theirs.
        self._built = pickle.dumps((modules_in_use(), build, arguments))
        self._workers: list[_Worker] = []
        self._pieces = 0

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # After an error or an interrupt a running job ends after its piece, or is killed.
        end = time.monotonic() + GRACE_S
        for worker in self._workers:
            with contextlib.suppress(OSError):
                worker.connection.send(None)
        for worker in self._workers:
            # Unread messages would block a worker that is about to end.
            with contextlib.suppress(OSError, EOFError):
                while worker.connection.poll(None if kind is None else _seconds_until(end)):
                    worker.connection.recv()
                worker.process.kill()  # it is still in its piece
            worker.process.join()
            worker.connection.close()
        self._workers.clear()

    def outcomes(self, jobs: deque[Job], done: Callable[[int], None]) -> Iterator[Ended]:
        """Run jobs and yield each when it has ended; see Workers."""
        self._pieces = 0
        while jobs or any(worker.job for worker in self._workers):
            self._assign(jobs)
            done(self._pieces + sum(worker.pieces for worker in self._workers))
            handles = {handle: worker for worker in self._workers for handle in worker.handles}
            ready = multiprocessing.connection.wait(list(handles), timeout=_POLL_S)
            for worker in dict.fromkeys(handles[handle] for handle in ready):
                yield from self._news(worker)
        done(self._pieces)

    def _assign(self, jobs: deque[Job]) -> None:
        """Give a job to every worker that has none, and start workers while jobs are left."""
        for worker in self._workers:
            if jobs and worker.job is None and not worker.last:
                self._send(worker, jobs.popleft())
        while jobs and len(self._workers) < self._count:
            worker = self._started()
            self._workers.append(worker)
            self._send(worker, jobs.popleft())

    def _started(self) -> _Worker:
        here, there = self._context.Pipe()
        process = self._context.Process(target=serve, args=(there, GROWTH_MB))
        with _interrupt_blocked(), _main_module_hidden(), safe_path(), reference_kernels():
            process.start()
        there.close()  # so that the end of the process is the end of the connection
        worker = _Worker(process, here)
        with contextlib.suppress(OSError):  # its death is noticed at its sentinel
            here.send_bytes(self._built)
        return worker

    def _send(self, worker: _Worker, job: Job) -> None:
        worker.job, worker.pieces = job, 0
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # noticed at its sentinel
            worker.connection.send(job)

    def _news(self, worker: _Worker) -> Iterator[Ended]:
        """Read all messages of a worker; yield its job if that has ended."""
        try:
            while worker.connection.poll():
                message: Message = worker.connection.recv()
                if not message.ended:
                    worker.pieces += 1
                    continue
                worker.last = message.last
                if isinstance(message.result, BaseException):
                    raise message.result
                job, worker.job = worker.job, None
                self._pieces += worker.pieces
                worker.pieces = 0
                assert job is not None
                yield Ended(job, message.result)
        except (EOFError, ConnectionResetError):
            worker.process.join()
            worker.connection.close()
            self._workers.remove(worker)
            if worker.job is not None:
                yield Ended(worker.job, None, WorkerDiedError())


def _seconds_until(end: float) -> float:
    """Return the time until `end` of the monotonic clock, at least 0 s."""
    return max(end - time.monotonic(), 0.0)


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
