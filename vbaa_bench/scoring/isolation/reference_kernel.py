"""A fixed computation that is timed between the frames of a method, to make times comparable.

Both are measured as processor time, which leaves out the time in which other programs run. What
these do to caches and clock remains; the kernel mixes many small calls of numpy with a compiled
pass over scattered memory, so that it slows down as the methods do.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Columns of predictions: the processor time of a frame, and that of the kernel after it.
PROCESSOR_COLUMN: Final = "processor_ms"
REFERENCE_COLUMN: Final = "reference_ms"

# Chosen: the kernel takes about 1 ms, as long as the fastest method takes for a frame, and half of
# it in each part. The scattered memory is 2 MB, larger than the nearest caches.
_SMALL_CALLS: Final = 60
_SMALL: Final = np.linspace(0.0, 1.0, 256)
_MATRIX: Final = np.vander(np.linspace(0.0, 1.0, 40), 4)
_SCATTERED: Final = np.sin(np.arange(1 << 18, dtype=np.float64))
_ORDER: Final = np.random.default_rng(0).permutation(1 << 18)[: 1 << 15]


def run_reference() -> None:
    """Run the kernel once."""
    _small_calls(_SMALL, _MATRIX)
    _scattered_pass(_SCATTERED, _ORDER)


def _small_calls(values: Floats, matrix: Floats) -> float:
    """Combine small arrays, values (n,) and matrix (m, 4), in many calls."""
    total = 0.0
    for number in range(_SMALL_CALLS):
        roots = np.sqrt(values * values + number)
        total += float(np.cumsum(roots)[-1]) + len(np.flatnonzero(roots > roots.mean()))
        if number % 10 == 0:
            total += float(np.linalg.lstsq(matrix, matrix[:, 0] + number, rcond=None)[0][0])
    return total


@njit
def _scattered_pass(memory: Floats, order: npt.NDArray[np.int64]) -> float:
    """Sum a function of values of `memory` (n,) in a random order (m,)."""
    total = 0.0
    for place in order:
        value = memory[place]
        total += np.exp(-value * value) if value > 0 else value * value * value
    return total
