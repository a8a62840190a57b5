"""Tests of the antenna and of its world."""

import fcntl
import gc
import os
import sys
from typing import Final

# Bytecode is kept whatever the user's setting, as in the Makefile: without it every process that a
# test starts compiles all modules, and every worker process rewrites all assertions again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# Linear algebra and tables in one thread: worker processes use all cores already, and threads that
# wait for each other use twice the processor's time, or more. NumPy and Polars read this when they
# are first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("POLARS_MAX_THREADS", "1")
# Until all tests are collected (conftest.py): modules and tests are no garbage.
gc.disable()


def _lock() -> int | None:
    """Wait for the first worker process to import and to collect everything.

    In a new environment, 17 of its 20 s are spent on bytecode, which the others then find. The
    processes that tests start do not wait.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ or "xdist" not in sys.modules:
        return None
    file = os.open(__file__, os.O_RDONLY)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        fcntl.flock(file, fcntl.LOCK_SH)
    return file


# Locked until this process has collected the tests (conftest.py).
COLLECTING: Final = _lock()
