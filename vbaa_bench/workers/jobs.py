"""Jobs, what runs them, and how a job ends or its process fails."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, NamedTuple, Self


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


class Job(NamedTuple):
    """Name of a method of the workers' object, and its arguments without the first."""

    method: str
    arguments: tuple[Any, ...]


class Ended(NamedTuple):
    """A job that has ended with a result, or with the `death` of its process."""

    job: Job
    result: Any
    death: WorkerDiedError | None = None


class Workers(ABC):
    """Workers, each holding an object that is built once; a job names one of its methods.

    The first argument of every method is a function to call after each finished piece.
    """

    def __enter__(self) -> Self:
        """Prepare the workers."""
        return self

    def __exit__(  # noqa: B027  # not all have something to end
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the workers."""

    @abstractmethod
    def outcomes(self, jobs: deque[Job], done: Callable[[int], None]) -> Iterator[Ended]:
        """Take jobs from the left, run them, and yield each when it has ended, by death or not.

        Jobs may be added meanwhile. `done` gets the number of finished pieces, without those of
        jobs whose process has died. Raises what a method raises, and WorkerStartError.
        """

    def survived(
        self,
        jobs: deque[Job],
        done: Callable[[int], None],
        again: Callable[[Job, WorkerDiedError], Job | None],
    ) -> Iterator[Ended]:
        """Yield only jobs that have ended with a result.

        Where a process has died, the job is replaced by the one that `again` returns, if any.
        Raises as `outcomes` does, and what `again` raises.
        """
        for ended in self.outcomes(jobs, done):
            if ended.death is None:
                yield ended
            elif (job := again(ended.job, ended.death)) is not None:
                jobs.append(job)

    def run(
        self,
        jobs: Sequence[tuple[str, tuple[Any, ...]]],
        done: Callable[[int], None] = lambda _pieces: None,
    ) -> list[Any]:
        """Run all jobs and return their results. `done` gets the number of finished pieces.

        Raises what a method raises, WorkerStartError or WorkerDiedError.
        """
        numbered = [Job(*job) for job in jobs]
        results = dict[int, Any]()
        for ended in self.outcomes(deque(numbered), done):
            if ended.death is not None:
                raise ended.death
            results[id(ended.job)] = ended.result
        return [results[id(job)] for job in numbered]

    def call(self, method: str, *arguments: Any) -> Any:
        """Run one job and return its result. Raises as `run` does."""
        return self.run([Job(method, arguments)])[0]


class SameProcess(Workers):
    """One object in this process."""

    def __init__(self, _count: int, build: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._object = build(*arguments)

    def outcomes(self, jobs: deque[Job], done: Callable[[int], None]) -> Iterator[Ended]:
        """Take jobs from the left, run them, and yield each when it has ended."""
        pieces = 0

        def piece_done() -> None:
            nonlocal pieces
            pieces += 1
            done(pieces)

        while jobs:
            job = jobs.popleft()
            yield Ended(job, getattr(self._object, job.method)(piece_done, *job.arguments))
