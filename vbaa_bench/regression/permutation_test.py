"""A permutation test of many correlated changes at once: swap old and new, push by push.

If nothing has changed, the old and the new result of a push are two draws of the same experiment,
and swapping them is as probable as not. All methods, quantities and strata of a push are swapped
together, so that their correlations are kept. The largest |t| of the whole table in each of many
random swaps is the distribution under no change; a cell whose |t| exceeds its 99 % quantile is
significant, and in one comparison of a hundred any cell is (Westfall and Young 1993, section 2.3).

This is exact for any number of pushes and any tails. A bootstrap of pushes is not: with nine pushes
it has too few distinct draws in the tails that hundreds of cells need. Holm's method is exact, but
neglects the correlations: hundreds of cells would need swaps with a probability of 3e-5.

Images of another dataset share errors that no swap of single pushes shows: those of its calibration
and its images at rest. They are drawn once for each dataset and added to the sums of the swaps.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Bools, Floats

Integers = npt.NDArray[np.int64]

# Probability of a false alarm in a whole table. From the requirement.
FALSE_ALARM: Final = 0.01
# Chosen: the quantile of 1 % is then known to 0.15 %.
_SWAPS: Final = 4999
# Chosen: blocks of 64 MB.
_BLOCK_VALUES: Final = 8_000_000


class ChangeTable(NamedTuple):
    """Changes of all cells, new minus old.

    `pushes` (u, c) has one row per push, NaN where a push is not in a cell. `shared_sigma` (c,) is
    the standard deviation of a cell's change that all its pushes have in common; cells of equal
    `shared_by` (c,), numbers from 0, share the same draw.
    """

    pushes: Floats
    shared_sigma: Floats
    shared_by: Integers


class Verdicts(NamedTuple):
    """Result of the test, one value per cell (c,).

    `p` is the probability that the largest |t| of an unchanged table is as large; `smallest` is the
    smallest common change of all pushes that would have been significant, infinite where none.
    """

    p: Floats
    smallest: Floats


def permutation_test(
    changes: ChangeTable, false_alarm: float, rng: np.random.Generator
) -> Verdicts:
    """Test all cells at once, with t = sum(d) / sqrt(sum(d^2) + (n s)^2).

    d are the changes of the n pushes of a cell, s its shared sigma. Swaps of old and new change the
    signs of d, but not the denominator. A cell is significant if its p is at most `false_alarm`,
    the probability that any cell of an unchanged table is.
    """
    present = np.isfinite(changes.pushes)
    d = np.where(present, changes.pushes, 0.0)
    n = present.sum(axis=0)
    shared = n * changes.shared_sigma
    scale = np.sqrt(np.square(d).sum(axis=0) + np.square(shared))
    inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
    observed = np.abs(d.sum(axis=0)) * inverse
    largest = np.concatenate(
        [
            _largest(d * inverse, shared * inverse, changes.shared_by, count, rng)
            for count in _blocks(len(d))
        ]
    )
    # Rounding must not make a swap of all pushes, or of none, differ from the observation.
    exceeding = (largest[:, None] >= observed * (1 - 1e-9)).sum(axis=0)
    critical = float(np.quantile(largest, 1 - false_alarm))
    return Verdicts((1 + exceeding) / (1 + _SWAPS), _smallest(d, present, n, shared, critical))


def _blocks(pushes: int) -> list[int]:
    most = max(_BLOCK_VALUES // max(pushes, 1), 1)
    return [min(most, _SWAPS - start) for start in range(0, _SWAPS, most)]


def _largest(
    d: Floats, shared: Floats, shared_by: Integers, count: int, rng: np.random.Generator
) -> Floats:
    """Draw the largest |t| of `count` tables without a change, (count,)."""
    signs = 2.0 * rng.integers(2, size=(count, len(d))) - 1.0
    draws = rng.standard_normal((count, int(shared_by.max()) + 1))[:, shared_by]
    return np.asarray(np.abs(signs @ d + draws * shared).max(axis=1))


def _smallest(d: Floats, present: Bools, n: Integers, shared: Floats, critical: float) -> Floats:
    """Solve t = critical for a common change of all pushes, with their spread as observed (c,)."""
    mean = np.divide(d.sum(axis=0), n, out=np.zeros(len(n)), where=n > 0)
    spread = (np.square(d - mean) * present).sum(axis=0)
    room = n * (n - critical**2)
    return np.asarray(
        np.sqrt(
            np.divide(
                critical**2 * (spread + np.square(shared)),
                room,
                out=np.full(len(n), np.inf),
                where=room > 0,
            )
        )
    )
