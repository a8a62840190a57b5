"""Imports at the start of a process, without searches for garbage."""

import contextlib
import gc
from collections.abc import Iterator


@contextlib.contextmanager
def quick_imports() -> Iterator[None]:
    """Import modules without garbage collection, and leave them out of later collections.

    Imports leave no garbage; the search for it was 40 % of the time to import the solver. For the
    start of a process only: what exists at the block's end is never searched again.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()
