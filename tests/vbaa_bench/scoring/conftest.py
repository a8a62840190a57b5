"""Methods that are not run: a process in name only."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import IO, Any

import pytest

from vbaa_bench.scoring.isolation import runs


@contextmanager
def _nothing_started(*_: Any) -> Iterator[tuple[IO[bytes], IO[bytes]]]:
    yield BytesIO(), BytesIO()


@pytest.fixture
def no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start no process for a method, in tests of what happens before it solves."""
    monkeypatch.setattr(runs, "_supervisor", _nothing_started)
