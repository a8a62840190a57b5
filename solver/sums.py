"""Sums over arrays that run in vector registers, as numpy's do not inside compiled code."""

from numba import njit

from solver.beam_models.exact import FAST
from solver.instrument.arrays import Floats


@njit(cache=True, error_model="numpy", fastmath=FAST)
def dot(a: Floats, b: Floats) -> float:
    """Of the products of a (n,) and b, whose further entries do not count."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total
