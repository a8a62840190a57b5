"""End the process at Ctrl-C during imports: exit status 130 and no traceback.

A module being imported could mistake an exception for a failed import, and nothing has to be saved
yet. For command lines only: in a notebook this would end the kernel.
"""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType


def _exit(_signal: int, _frame: FrameType | None) -> None:
    os._exit(130)


def heed_interrupts() -> None:
    """Let SIGINT interrupt this process, even if a script has started it in the background.

    Shells start such a process with SIGINT ignored: `kill -INT`, and Ctrl-C in the script's
    terminal, would leave it and its workers running. Every command can be interrupted and repeated.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """End the process at Ctrl-C within this block; restore KeyboardInterrupt after it.

    Nothing is changed if Ctrl-C is ignored or already has another handler.
    """
    default_handler = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not default_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, _exit)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGINT) is _exit:
            signal.signal(signal.SIGINT, signal.default_int_handler)
