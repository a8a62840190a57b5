"""Medians in compiled code, and constants of robust statistics.

numba's own median takes longer: the processor mispredicts half of its branches.
"""

from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Standard deviation over the median absolute deviation of normally distributed values.
SIGMA_OVER_MAD: Final = 1.4826
# Tukey's biweight is 0 beyond this many standard deviations: its efficiency for white noise is 95 %
# (Holland and Welsch 1977).
TUKEY_CUT: Final = 4.685


@njit
def median(values: Floats) -> float:
    """Compute the median of values (n,), none of which may be NaN; NaN for n = 0."""
    n, ordered = len(values), values.copy()
    if n == 0:
        return np.nan
    middle = n // 2
    _select(ordered, middle)
    if n % 2 == 1:
        return float(ordered[middle])
    before = -np.inf
    for i in range(middle):
        before = max(before, ordered[i])
    return float((before + ordered[middle]) / 2)


@njit
def quantile(values: Floats, share: float) -> float:
    """Compute a quantile of values (n,), n > 0, linear between two of them; none may be NaN.

    numba's own takes two seconds to compile.
    """
    ordered, place = values.copy(), share * (len(values) - 1)
    k = min(int(place), len(values) - 1)
    _select(ordered, k)
    below, above = ordered[k], np.inf
    for i in range(k + 1, len(ordered)):
        above = min(above, ordered[i])
    part = place - k
    return float(below + part * (above - below)) if part > 0 else float(below)


@njit
def _select(values: Floats, k: int) -> None:
    """Reorder values so that entry k is that of the sorted array, and none before it is larger.

    This is Hoare's quickselect (1961). No branch of its inner loops depends on a value.
    """
    first, last = 0, len(values) - 1
    while first < last:
        a, b, c = values[first], values[(first + last) // 2], values[last]
        pivot = max(min(a, b), min(max(a, b), c))
        # Move the values below the pivot to the front, then those equal to it.
        equal = first
        for i in range(first, last + 1):
            value = values[i]
            values[i] = values[equal]
            values[equal] = value
            equal += value < pivot
        if k < equal:
            last = equal - 1
            continue
        first = equal
        for i in range(equal, last + 1):
            value = values[i]
            values[i] = values[first]
            values[first] = value
            first += value <= pivot
        if k < first or first == equal:
            return
