"""Tests of the antenna and of its world."""

import gc
import os

# Linear algebra in one thread: worker processes use all cores already, and threads that wait for
# each other use twice the processor's time, or more. NumPy reads this when it is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Until all tests are collected (conftest.py): modules and tests are no garbage.
gc.disable()
