"""Bootstrap intervals of medians that are fast enough for every stratum of a large dataset."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats

# Chosen: limits then scatter by a few per cent of the interval's width.
_RESAMPLES: Final = 1000
# Chosen: more pushes are joined at random to this many blocks, more values to this many classes of
# equal size; the interval of 10,000 frames then moves by less than a tenth of its width.
_MAX_BLOCKS: Final = 200
_MAX_CLASSES: Final = 512


class Interval(NamedTuple):
    """Limits of a 95 % interval."""

    low: float
    high: float


def median_interval(values: Floats, groups: npt.NDArray[np.int64]) -> Interval | None:
    """Compute the 95 % bootstrap interval of the median of `values` (n,).

    Whole groups are resampled, `groups` (n,) numbers them: errors within a push are correlated.
    None for fewer than two groups. The medians of all resamples follow from one product of
    matrices: how often each block is drawn, times the block's values per class.
    """
    names, block = np.unique(groups, return_inverse=True)
    if len(names) < 2:
        return None
    random = np.random.default_rng(0)
    blocks = min(len(names), _MAX_BLOCKS)
    block = random.permutation(len(names))[block] % blocks
    ordered = np.sort(values)
    starts = np.unique(np.linspace(0, len(values) - 1, _MAX_CLASSES).astype(int))
    floors = np.unique(ordered[starts])
    label = np.searchsorted(floors, values, side="right") - 1
    counts = np.zeros((blocks, len(floors)))
    np.add.at(counts, (block, label), 1)
    draws = random.multinomial(blocks, np.full(blocks, 1 / blocks), size=_RESAMPLES)
    reached = np.cumsum(draws @ counts, axis=1)
    medians = floors[np.argmax(reached >= reached[:, -1:] / 2, axis=1)]
    low, high = np.quantile(medians, [0.025, 0.975])
    return Interval(float(low), float(high))
