"""Jobs of worker processes, how a job ends, and how a worker process fails."""

from typing import Any, NamedTuple

from solver.instrument.errors import InputError


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


class ImageError(InputError):
    """An image cannot be rendered without which there is no dataset."""


class Job(NamedTuple):
    """Name of a method of the workers' object, and its arguments without the first."""

    method: str
    arguments: tuple[Any, ...]


class Ended(NamedTuple):
    """A job that has ended with a result, or with the `death` of its process."""

    job: Job
    result: Any
    death: WorkerDiedError | None = None


class Message(NamedTuple):
    """What a worker sends when a piece of its job is finished, or the job itself has `ended`.

    `result` is that of the job, or the error in it. After the `last` one the process ends.
    """

    ended: bool
    result: Any = None
    last: bool = False
