"""Dot products in vector registers inside compiled code."""

from typing import Final

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Reordered sums and fused products let loops run in vector registers; NaN and infinity are still
# allowed.
FAST: Final = {"reassoc", "contract", "nsz", "arcp"}


@njit(fastmath=FAST)
def dot(a: Floats, b: Floats) -> float:
    """Compute the dot product of `a` (n,) with the first n entries of `b`."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total
