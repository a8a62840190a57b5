"""Compile the fits in a second process while this one compiles the centreline, at a first start."""

import contextlib
import json
import pickle
import subprocess
import sys
from collections.abc import Iterator

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import compiled_functions
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Rig
from solver.instrument.safe_path import PYTHON
from solver.methods.exact_fit import exact_fit

# Displacement of outliers: every fit rejects them, and succeeds with the other points.
_OUTLIER_SIGMAS = 60.0
# Number and height of waves. Chosen: the fits succeed, and residuals of neighbours are alike.
_WAVES, _WAVE_SIGMAS = 10.0, 2.0
# The function of the fits that is compiled last.
_LAST_OF_FITS = "starts.consensus"
# The process finds the modules where this one does.
_CHILD = """
import json, pickle, sys
sys.path[:] = json.loads(sys.argv[1])
from solver.instrument.quick_imports import quick_imports
with quick_imports():
    from solver.first_start import compile_fits
compile_fits(pickle.load(sys.stdin.buffer))
"""


def is_first_start() -> bool:
    """Return whether the fits are not compiled yet; False if it cannot be known."""
    compiled = compiled_functions()
    return compiled is not None and _LAST_OF_FITS not in compiled


@contextlib.contextmanager
def compile_in_background(rig: Rig) -> Iterator[None]:
    """Compile the fits in a process of their own during this block, unless they are compiled.

    Nothing is done if it cannot be known whether they are. The block's end waits for the process.
    If that fails, they are compiled when they are used.
    """
    if not is_first_start():
        yield
        return
    command = [*PYTHON, "-c", _CHILD, json.dumps(sys.path)]
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
    straight = length * np.column_stack([np.linspace(0.02, 0.98, 200), np.zeros(200)])
    sigmas = np.full_like(straight, 1e-5 * length) * (0.0, 1.0)
    bent = touched_in_the_middle(straight, length)
    viewpoint = np.array([length / 2, 0.0, 1.5 * length, 1.0])
    base_covariance = np.diag([1e-4 * length, 1e-5 * length, 1e-4]) ** 2
    for points in (bent, with_outliers(bent, sigmas)):
        view = View(points, sigmas, viewpoint)
        exact_fit(Measurement(view, base_covariance, 1e-4, 0.0, rig))


def touched_in_the_middle(points: Floats, length: float) -> Floats:
    """Bend a straight beam's points (n, 2) [m] as if touched in the middle, the tip by 3 %."""
    x = np.clip(points[:, 0] / length, 0.0, 1.0)
    y = 0.05 * length * np.where(x < 0.5, x**2 * (1.5 - x), 0.75 * x - 0.125)
    return np.column_stack([points[:, 0], points[:, 1] + y])


def with_outliers(points: Floats, sigma_vectors: Floats) -> Floats:
    """Displace one point (n, 2) in twenty so far that every fit rejects it."""
    is_outlier = (np.arange(len(points)) % 20 == 0)[:, None]
    return np.asarray(points + _OUTLIER_SIGMAS * sigma_vectors * is_outlier)


def with_shared_errors(points: Floats, sigma_vectors: Floats) -> Floats:
    """Displace points (n, 2) by waves along the beam, which a fit takes for no white noise."""
    waves = np.sin(np.linspace(0.0, 2 * np.pi * _WAVES, len(points)))[:, None]
    return np.asarray(points + _WAVE_SIGMAS * sigma_vectors * waves)
