"""Tests of the antenna and of its world."""

import gc
import os
import sys

# Bytecode is kept whatever the user's setting, as in the Makefile: without it every process that a
# test starts compiles all modules, and every worker process rewrites all assertions again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# Linear algebra in one thread: worker processes use all cores already, and threads that wait for
# each other use twice the processor's time, or more. NumPy reads this when it is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Until all tests are collected (conftest.py): modules and tests are no garbage.
gc.disable()
