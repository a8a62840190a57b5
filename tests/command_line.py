"""Command lines run in this process, which saves the seconds that a new process imports for."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest


class Ended(NamedTuple):
    """Exit status and output of a command."""

    status: int
    out: str
    err: str


class CommandLine:
    """A command line's `main`, called with the words that a person types.

    The output is captured at the file descriptors, so it includes that of libraries and children.
    """

    def __init__(self, main: Callable[[], None], capture: pytest.CaptureFixture[str]) -> None:
        self._main, self._capture = main, capture

    def __call__(self, *words: str | Path) -> Ended:
        """Run the command with these words."""
        self._capture.readouterr()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", ["command", *map(str, words)])
            with pytest.raises(SystemExit) as ended:
                self._main()
        code = ended.value.code
        status = code if isinstance(code, int) else int(code is not None)
        return Ended(status, *self._capture.readouterr())

    def refused(self, *words: str | Path) -> str:
        """Return the one sentence that a mistake gets on stderr, with exit status 2."""
        ended = self(*words)
        assert (ended.status, ended.out) == (2, ""), ended
        assert ended.err.startswith("error: ")
        assert ended.err.count("\n") == 1
        return ended.err
