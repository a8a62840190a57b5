"""A fixed computation that is timed between the frames of a method, to make times comparable.

The time of a method over that of this kernel does not depend on the clock or the load of the
machine, because both are timed alternately in one process. The kernel mixes what methods do: long
chains of arithmetic, and passes over the pixels of an image.
"""

import time
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit

# Column of the kernel's time after a frame, in predictions.
REFERENCE_COLUMN: Final = "reference_ms"

# Chosen: the kernel takes about 1 ms, as long as the fastest method takes for a frame.
_IMAGE: Final = np.arange(256 * 512, dtype=np.uint8).reshape(256, 512)
_CHAIN: Final = 120_000


def time_reference_ms() -> float:
    """Run the kernel once; return its time [ms]."""
    start = time.perf_counter()
    _kernel(_IMAGE, _CHAIN)
    return 1e3 * (time.perf_counter() - start)


@njit
def _kernel(image: Grey, chain: int) -> Floats:
    """Solve a recurrence of `chain` steps, and sum the columns of an image (height, width)."""
    sums = np.zeros(image.shape[1])
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            sums[column] += image[row, column] * 0.5
    value = 1.0
    for step in range(chain):
        # A division and a root in each step depend on the last: no compiler can run them at once.
        value = np.sqrt(2.0 + value) / (1.0 + 1e-6 * step)
    sums[0] += value
    return sums
