"""Bootstrap over pushes: draws of whole pushes, and the intervals of means, shares and medians.

Frames of one push share its calibration errors and its contact, and repeats of a push share what
the scene fixes; as independent samples they would make intervals too narrow (Efron and Tibshirani
1993, chapter 8). So groups of frames are resampled with replacement. For speed, a draw is a row of
group counts, and a statistic of the draw is computed from sums over groups.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import polars as pl

from solver.instrument.arrays import Floats

# Chosen: the limits of an interval then scatter by a few per cent of its width.
DRAWS: Final = 1000
# Of a share, of which a draw costs little.
_SHARE_DRAWS: Final = 2000
# More groups are merged, in the order of a random permutation. Chosen: from 400 groups on, the
# variance of the draws has a relative error of 7 %, and more groups cost time only.
MAX_GROUPS: Final = 400
# Ranks per bin in which a median is located first. Chosen: about the square root of 100,000.
_BIN: Final = 256
_LEVELS: Final = (0.025, 0.975)


class Interval(NamedTuple):
    """A 95 % interval."""

    low: float
    high: float


def group_numbers(rows: pl.DataFrame, over: Sequence[str] | None = None) -> npt.NDArray[np.int64]:
    """Number the resampled group (n,) of each row from 0, at most MAX_GROUPS of them.

    Without `over`, frames of one push, and repeats of the same push, are a group: same object, same
    place, same first target and same cover. `over` names columns that identify a group instead.
    """
    first = pl.col("push").sort_by("step").first().over("push_id")
    place = ("contact_distance_at_rest_mm", "normal_deg", "k_s_n_m", "hidden_place")
    keys = [first, *map(pl.col, place)] if over is None else [pl.col(name) for name in over]
    numbers = rows.select(pl.struct(keys).rank("dense").cast(pl.Int64) - 1).to_series().to_numpy()
    count = int(numbers.max()) + 1 if len(numbers) else 0
    if count > MAX_GROUPS:
        merged = np.random.default_rng(0).permutation(count) % MAX_GROUPS
        numbers = merged[numbers]
    return np.asarray(numbers, np.int64)


def draws(groups: int, number: int = DRAWS, size: int | None = None, seed: int = 0) -> Floats:
    """Draw how often each group is in each of a number of resamples, (number, groups).

    A resample has `size` groups, by default all; of groups - 1, the variance of a mean is unbiased
    (McCarthy and Snowden 1985), which matters where sets of a few groups are combined. These need
    a `seed` each, or their draws are not independent.
    """
    indices = np.random.default_rng(seed).integers(groups, size=(number, size or groups))
    rows = np.arange(number)[:, None] * groups
    counts = np.bincount((rows + indices).ravel(), minlength=number * groups)
    return counts.reshape(number, groups).astype(np.float64)


def interval(statistics: Floats) -> Interval | None:
    """Compute the percentile interval of the statistics (DRAWS,) of all draws, NaN ones left out.

    None if no statistic is finite.
    """
    finite = statistics[np.isfinite(statistics)]
    return Interval(*map(float, np.quantile(finite, _LEVELS))) if len(finite) else None


def share_interval(successes: Floats, cases: Floats) -> Interval | None:
    """Compute the interval of a share from the successes and cases of each group, both (groups,).

    None for fewer than two groups.
    """
    if len(cases) < 2:
        return None
    counts = draws(len(cases), _SHARE_DRAWS)
    return interval(counts @ successes / (counts @ cases))


def median_interval(values: pl.Series, groups: npt.NDArray[np.int64]) -> Interval | None:
    """Compute the interval of the median of |values| (n,), by their groups (n,).

    Nulls do not count. None for fewer than two groups.
    """
    known = values.is_not_null().to_numpy()
    names, numbers = np.unique(groups[known], return_inverse=True)
    if len(names) < 2:
        return None
    return interval(median_draws(values.drop_nulls(), numbers, draws(len(names))))


def median_draws(values: pl.Series, groups: npt.NDArray[np.int64], counts: Floats) -> Floats:
    """Compute the median of |values| (n,) in each draw, (draws,), by their groups (n,).

    `counts` (draws, groups) are those of `draws`. Nulls do not count; a draw without any other
    value has NaN.
    """
    known = values.is_not_null().to_numpy()
    if not known.any():
        return np.full(len(counts), np.nan)
    magnitudes, numbers = np.abs(values.drop_nulls().to_numpy()), groups[known]
    order = np.argsort(magnitudes, kind="stable")
    ordered, of_group = magnitudes[order], numbers[order]
    # Counts per group and bin of ranks locate each draw's median in a bin; only the bins that
    # hold a median of some draw are then resolved to single values.
    bins = np.arange(len(ordered)) // _BIN
    per_bin = np.zeros((counts.shape[1], bins[-1] + 1))
    np.add.at(per_bin, (of_group, bins), 1.0)
    below = np.cumsum(counts @ per_bin, axis=1)
    empty = below[:, -1] == 0
    below[empty] += 1  # any median will do: it is replaced below
    half = below[:, -1:] / 2
    first, last = (below >= half).argmax(axis=1).min(), (below > half).argmax(axis=1).max()
    inner = slice(first * _BIN, (last + 1) * _BIN)
    start = below[:, [first - 1]] if first else np.zeros((len(counts), 1))
    upto = start + np.cumsum(counts[:, of_group[inner]], axis=1)
    # An even number of values has two in its middle.
    lower, upper = (upto >= half).argmax(axis=1), (upto > half).argmax(axis=1)
    medians = (ordered[inner][lower] + ordered[inner][upper]) / 2
    return np.where(empty, np.nan, medians)
