"""Peaks of a curve. `scipy.signal` has them too: to import it takes a third of a start's time."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats


class Peak(NamedTuple):
    """The index `place` of a local maximum, the middle one of equal values, and its prominence.

    The prominence is its height above the higher of the two lowest values that separate it from
    higher values, or from the ends, on its left and on its right.
    """

    place: int
    prominence: float


def find_peaks(values: Floats, prominence: float) -> Iterator[Peak]:
    """Yield the peaks of at least this prominence in `values` (n,), without those at its ends."""
    first = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    last = np.append(first[1:], len(values)) - 1
    heights = values[first]
    top = 1 + np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:]))
    for start, stop, height in zip(first[top], last[top], heights[top], strict=True):
        sides = values[start::-1], values[stop:]
        found = height - max(_least_before_higher(side) for side in sides)
        if found >= prominence:
            yield Peak(int(start + stop) // 2, float(found))


def _least_before_higher(values: Floats) -> float:
    """Return the least value before the first one that is higher than `values[0]`, or of all."""
    higher = values > values[0]
    return float(values[: np.argmax(higher) if higher.any() else None].min())
