"""How sums over arrays run in vector registers inside compiled code."""

from typing import Final

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Reordered sums and fused products let loops run in vector registers; no special value is assumed
# away.
FAST: Final = {"reassoc", "contract", "nsz", "arcp"}


@njit(cache=True, error_model="numpy", fastmath=FAST)
def dot(a: Floats, b: Floats) -> float:
    """Of the products of a (n,) and b, whose further entries do not count."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total
