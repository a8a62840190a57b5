"""After the warm-up nothing is compiled any more, whatever a frame shows."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.draws import scene_seed

# In a process of its own: others' frames would have compiled everything already.
_SCRIPT = """
import gc, sys
from pathlib import Path
import numpy as np
from numba.core.dispatcher import Dispatcher
from solver.set_up import set_up
from solver.instrument.observation import open_observations
from solver.lab.live import warm_up
from solver.methods import METHODS
from solver.tracker import PushTracker

def signatures():
    return {
        (d.py_func.__qualname__, str(signature))
        for d in gc.get_objects()
        if isinstance(d, Dispatcher) and d.py_func.__module__.startswith("solver")
        for signature in d.signatures
    }

opened, method = open_observations(Path(sys.argv[1])), METHODS[sys.argv[2]]
antenna = set_up(opened)
warm_up(antenna, method, next(opened.read_rest_images()))
before = signatures()
assert len(before) > 20
tracker, random, rejected = PushTracker(antenna, method), np.random.default_rng(int(sys.argv[3])), 0
for frame in opened.frames:
    plain = frame.image()
    dead = random.random(plain.shape) < 0.03
    spots = np.where(dead, 255 * (random.random(plain.shape) < 0.5), plain).astype(np.uint8)
    # A step by three pixels in the middle of the beam, which the extractor takes for the beam.
    step = plain.copy()
    step[:, 200:240] = np.roll(plain, 3, axis=0)[:, 200:240]
    half = np.where(np.arange(plain.shape[1]) < 330, plain, np.median(plain)).astype(np.uint8)
    for image in (plain, spots, step, half, np.zeros_like(plain)):
        solved = tracker.solve(image, frame.readings, frame.push_id)
        rejected += 0 if solved.line is None else len(solved.line.rejected)
assert rejected > 100
print(sorted(signatures() - before))
"""


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["exact_fit", "push_fit"])
def test_nothing_is_compiled_after_the_warm_up(dataset: Path, method: str) -> None:
    command = [
        sys.executable,
        "-c",
        _SCRIPT,
        str(dataset / "observations"),
        method,
        str(scene_seed(0)),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
