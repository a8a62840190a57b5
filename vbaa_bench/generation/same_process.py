"""The interface of the pool of workers, without worker processes."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Self

from vbaa_bench.generation.job import Ended, Job


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
        self,
        jobs: Sequence[tuple[str, tuple[Any, ...]]],
        done: Callable[[int], None] = lambda _pieces: None,
    ) -> list[Any]:
        """Run all jobs and return their results. `done` gets the number of finished pieces."""
        return [ended.result for ended in self.outcomes(deque(Job(*job) for job in jobs), done)]

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
