"""How a command line ends: one sentence and an exit status, whatever has happened."""

import contextlib
import errno
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Final, NoReturn

from solver.instrument.errors import IncompleteError, InputError

# What a full disk, a quota or a device answers when a command writes to its output.
_UNWRITABLE: Final = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO", "EPIPE")
    if hasattr(errno, name)
}
# Signals that end a command as Ctrl-C does: the terminal was closed, or another process asks.
_ENDING: Final = [getattr(signal, name) for name in ("SIGHUP", "SIGTERM") if hasattr(signal, name)]


def run_command(run: Callable[[], object]) -> NoReturn:
    """Run a command line and exit.

    The exit status is 2 for an InputError and for an output that cannot be written, 1 for an input
    that ends too early, 130 for Ctrl-C, and 128 + its number for a signal that asks the process to
    end, which is otherwise treated as Ctrl-C. Characters that the output cannot represent are
    replaced.
    """
    _accept_every_character()
    status = 0
    try:
        with _interrupted_by_signals() as received:
            try:
                run()
            finally:
                sys.stdout.flush()
    except KeyboardInterrupt:
        status = 130
    except SystemError as error:
        # Of a Ctrl-C within compiled code, numba makes this error.
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        status = 130
    except IncompleteError as error:
        _sentence(str(error))
        status = 1
    except InputError as error:
        status = _sentence(str(error))
    except SystemExit as error:
        status = error.code if isinstance(error.code, int) else int(error.code is not None)
    except OSError as error:
        if error.errno not in _UNWRITABLE or error.filename is not None:
            raise
        # The reader of a pipe has ended, as `head` does, and wants no more.
        is_unread = isinstance(error, BrokenPipeError)
        status = 1 if is_unread else _sentence(f"the output cannot be written ({error.strerror})")
        # What is still in the buffer would be a second error at the end of the process.
        with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
    sys.exit(128 + received[0] if received else status)


def _sentence(text: str) -> int:
    """Print an error to stderr, where that is possible; return the exit status."""
    with contextlib.suppress(OSError):
        print(f"error: {text}", file=sys.stderr, flush=True)
    return 2


def _accept_every_character() -> None:
    """Let no character of a message be an error, in ASCII for example; and no closed output."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115  # to the end
        elif isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="replace")


@contextlib.contextmanager
def _interrupted_by_signals() -> Iterator[list[int]]:
    """Let signals that end a process raise KeyboardInterrupt; provide the list of those received.

    A signal that is ignored, as by nohup, stays so.
    """
    received = list[int]()

    def interrupt(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
    handled = [s for s in _ENDING if is_main and signal.getsignal(s) is signal.SIG_DFL]
    for number in handled:
        signal.signal(number, interrupt)
    try:
        yield received
    finally:
        for number in handled:
            signal.signal(number, signal.SIG_DFL)
