"""Stand-in for a pool of workers: its jobs run in this process, where the renderer is loaded."""

from collections.abc import Callable, Sequence
from typing import Any, Self


class OneProcess:
    """Pool of no processes: `build(*arguments)` and its methods run in the caller's process."""

    def __init__(self, _count: int, build: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._resident, self._pieces = build(*arguments), 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def call(self, method: str, *arguments: Any) -> Any:
        return getattr(self._resident, method)(self._count, *arguments)

    def run(
        self, jobs: Sequence[tuple[str, tuple[Any, ...]]], done: Callable[[int], None]
    ) -> list[Any]:
        results = [self.call(method, *arguments) for method, arguments in jobs]
        done(self._pieces)
        return results

    def _count(self) -> None:
        self._pieces += 1
