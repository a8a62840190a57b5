"""Python processes that import nothing from the folder in which they are started.

By itself Python imports a file `struct.py` of the current folder instead of its own module, where
it is started with -c or -m, as `multiprocessing` does.
"""

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Final

# The beginning of a command line.
PYTHON: Final = (sys.executable, "-P")
_VARIABLE: Final = "PYTHONSAFEPATH"


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Let all processes that are started within this block ignore the current folder."""
    before = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_VARIABLE]
        else:
            os.environ[_VARIABLE] = before
