"""Ctrl-C while a command is still importing: its end, with exit status 130 and no traceback.

Importing this module changes what Ctrl-C does: `vbaa_bench.cli` imports it before what is slow,
and calls `raise_again` after it.
"""

import os
import signal
import threading
from types import FrameType


def _exit(_signal: int, _frame: FrameType | None) -> None:
    os._exit(130)  # an exception could be taken for a failed import, and there is nothing to save


def raise_again() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _exit:
        signal.signal(signal.SIGINT, signal.default_int_handler)


# Only where Ctrl-C would raise: who ignores it, or handles it, goes on doing so.
_usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
if _usual and threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, _exit)
