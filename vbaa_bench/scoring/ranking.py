"""Ranks of methods by a paired bootstrap: methods that cannot be distinguished are ties.

All methods are resampled with the same draws of pushes, or of rigs. The statistics of two methods
then contain the same easy and hard pushes in each draw, and the interval of their difference is
that of the methods alone (Efron and Tibshirani 1993, chapter 8).
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt
import polars as pl

from solver.instrument.arrays import Floats
from solver.methods import METHODS
from vbaa_bench.scoring.bootstrap import interval, median_draws
from vbaa_bench.scoring.statistics import MEAN, MEDIAN, RMS, Statistic

# With fewer pushes, or rigs, methods are not distinguished. Derived: by chance alone, one of two
# equal methods is better in all of n pushes with a probability of 2 / 2^n, 6 % for five.
FEWEST_GROUPS: Final = 6
# Processor time of a frame over that of the reference kernel, timed after it in the same process:
# comparable between runs and machines, unlike milliseconds.
TIME_OVER_REFERENCE: Final = Statistic(
    "median processor time over that of the reference kernel",
    MEDIAN,
    pl.col("processor_ms") / pl.when(pl.col("reference_ms") > 0).then("reference_ms"),
    null="no time was measured beside the reference kernel",
)


def statistic_draws(
    one: Statistic, rows: pl.DataFrame, groups: npt.NDArray[np.int64], counts: Floats
) -> Floats:
    """Compute a mean, root mean square or median of rows of the scores in each draw, (draws,).

    `groups` (n,) are the numbers of the rows' groups, and `counts` (draws, groups) how often each
    is in a draw. A draw in which no row counts has NaN, and so have all with fewer than two groups.
    """
    undefined = one.defined is not None and not rows.select(one.defined).item()
    if undefined or counts.shape[1] < 2:
        return np.full(len(counts), np.nan)
    term = one.term.cast(pl.Float64)
    term = term if one.where is None else pl.when(one.where).then(term)
    values = rows.select(term.alias("value")).to_series()
    if one.reduction is MEDIAN:
        statistic = median_draws(values, groups, counts)
    else:
        # The other reductions are no functions of sums over groups.
        assert one.reduction in (MEAN, RMS)
        known = values.is_not_null().to_numpy()
        numbers = values.drop_nulls().to_numpy()
        weights = numbers if one.reduction is MEAN else numbers**2
        sums = np.bincount(groups[known], weights, counts.shape[1])
        cases = counts @ np.bincount(groups[known], minlength=counts.shape[1])
        means = np.divide(counts @ sums, cases, out=np.full(len(counts), np.nan), where=cases > 0)
        statistic = means if one.reduction is MEAN else np.sqrt(means)
    if one.over is not None:
        divisor = statistic_draws(one.over, rows, groups, counts)
        statistic = np.divide(
            statistic, divisor, out=np.full(len(counts), np.nan), where=divisor > 0
        )
    return 100 * statistic if one.in_percent else statistic


def is_smaller(one: Floats, other: Floats, margin: float = 0.0) -> bool:
    """Test whether a statistic is smaller than another one, from the same draws (draws,) of both.

    It is if the 95 % interval of their difference is above 0. The other statistic must also be
    larger by the fraction `margin`.
    """
    ends = interval(other - (1 + margin) * one)
    return ends is not None and ends.low > 0


def ranks(statistics: Mapping[str, Floats], margin: float = 0.0) -> dict[str, int]:
    """Rank methods by draws (draws,) of a statistic, the smallest first, which has rank 1.

    A rank is one more than the number of methods that are smaller, see `is_smaller`: methods that
    cannot be distinguished from the best one share rank 1.
    """
    return {
        name: 1 + sum(is_smaller(better, own, margin) for better in statistics.values())
        for name, own in statistics.items()
    }


def by_solve(name: str) -> bool:
    """Test whether predictions of this name are written by `solve`, which measures their times.

    A user's own file has neither the name of a method nor a dot, see `score.with_own`.
    """
    return name.partition("@")[0] in METHODS or "." in name
