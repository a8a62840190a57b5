"""Compile the fits in a second process while this one compiles the centreline, at a first start."""

import contextlib
import json
import pickle
import subprocess
import sys
from collections.abc import Iterator

import numpy as np

from solver.instrument.compiled import compiled_functions
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Rig
from solver.methods.exact_fit import exact_fit

# The function of the fits that is compiled last.
_LAST_OF_FITS = "frame_fit.settle"
# The process finds the modules where this one does.
_CHILD = """
import json, pickle, sys
sys.path[:] = json.loads(sys.argv[1])
from solver.first_start import compile_fits
compile_fits(pickle.load(sys.stdin.buffer))
"""


@contextlib.contextmanager
def fits_compiled_beside(rig: Rig) -> Iterator[None]:
    """Compile the fits in a process of their own during this block, unless they are compiled.

    The block's end waits for the process. If that fails, they are compiled when they are used.
    """
    if _LAST_OF_FITS in compiled_functions():
        yield
        return
    command = [sys.executable, "-c", _CHILD, json.dumps(sys.path)]
    child = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        assert child.stdin is not None
        with contextlib.suppress(BrokenPipeError), child.stdin as pipe:
            pickle.dump(rig, pipe)
        yield
        child.wait()
    finally:
        child.kill()
        child.wait()


def compile_fits(rig: Rig) -> None:
    """Fit synthetic measurements of a beam touched in the middle, without and with outliers.

    The clamp's and the points' errors are of the order of an ordinary camera's.
    """
    length = rig.beam.length
    x = np.linspace(0.02, 0.98, 200)
    y = 0.05 * np.where(x < 0.5, x**2 * (1.5 - x), 0.75 * x - 0.125)
    points = length * np.column_stack([x, y])
    sigmas = np.full_like(points, 1e-5 * length) * (0.0, 1.0)
    stray = 60 * sigmas * (np.arange(len(x)) % 20 == 0)[:, None]
    viewpoint = np.array([length / 2, 0.0, 1.5 * length, 1.0])
    base_covariance = np.diag([1e-4 * length, 1e-5 * length, 1e-4]) ** 2
    for outliers in (0.0, stray):
        view = View(points + outliers, sigmas, viewpoint)
        exact_fit(Measurement(view, base_covariance, 1e-4, 0.0, rig))
