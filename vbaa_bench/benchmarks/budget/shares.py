"""Shares of the causes in the error of x_c: bias, RMSE, and their intervals over pushes."""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats
from vbaa_bench.benchmarks.budget.errors import Errors
from vbaa_bench.benchmarks.budget.stages import Cause
from vbaa_bench.report.budget import REMAINDER, TOTAL
from vbaa_bench.scoring.bootstrap import draws, interval

NOISE: Final = "noise of the points"
SYSTEMATIC: Final = "systematic error of the points"


class Share(NamedTuple):
    """Part of the error that one cause contributes, and a 95 % interval of its RMSE.

    The RMSE is the root of a mean square or, for the systematic error and the remainder, of a
    difference of mean squares: it has the sign of that difference.
    """

    bias: float
    rmse: float
    low: float
    high: float


class _Square(NamedTuple):
    """A cause's mean error, and a square (n,) per frame whose mean is its mean square."""

    bias: float
    squares: Floats


def errors_by_cause(by_stage: Floats) -> Floats:
    """Compute each cause's error (stages, n) from the errors (stages, n) at the stages.

    A cause's error of a frame is the difference of two consecutive stages; the last stage's error
    is that of the last cause. Their sum is the error as measured, exactly.
    """
    return np.concatenate([by_stage[:-1] - by_stage[1:], by_stage[-1:]])


def usable_frames(errors: Errors) -> npt.NDArray[np.bool_]:
    """Return which frames (n,) were answered at every stage and with every simulated noise."""
    return np.asarray(
        np.isfinite(errors.by_stage).all(axis=0) & np.isfinite(errors.by_noise).all(axis=0)
    )


def shares_of(
    errors: Errors, causes: Sequence[Cause], groups: npt.NDArray[np.int64]
) -> dict[str, Share]:
    """Compute the share of every cause in the errors of n frames, all of them usable.

    The points' error is split: its noise is what white noise with the stated sigmas causes, its
    systematic part the rest of its mean square. The remainder is the total's mean square without
    all shares': twice the products of their errors. It is negative where causes cancel. `groups`
    (n,) number the pushes, which are resampled together.
    """
    by_cause = errors_by_cause(errors.by_stage)
    total = _Square(float(errors.by_stage[0].mean()), errors.by_stage[0] ** 2)
    named = {
        str(cause): _Square(float(e.mean()), e**2)
        for cause, e in zip(causes, by_cause, strict=True)
    }
    others = total.squares - sum(square.squares for square in named.values())
    if len(errors.by_noise):
        points = named.pop(str(Cause.CENTRELINE))
        noise = errors.by_noise - errors.by_stage[1]
        simulated = _Square(float(noise.mean()), (noise**2).mean(axis=0))
        split = {
            NOISE: simulated,
            SYSTEMATIC: _Square(points.bias - simulated.bias, points.squares - simulated.squares),
        }
        named = split | named
    named = {TOTAL: total, **named, REMAINDER: _Square(0.0, np.asarray(others))}
    mean = _resampler(groups)
    return {
        name: Share(square.bias, _root(square.squares.mean()), *mean(square.squares))
        for name, square in named.items()
    }


def _resampler(groups: npt.NDArray[np.int64]) -> Callable[[Floats], tuple[float, float]]:
    """Return a function from squares (n,) to the interval of the root of their mean."""
    _, numbers = np.unique(groups, return_inverse=True)
    sizes = np.bincount(numbers)
    counts = draws(len(sizes))

    def limits(squares: Floats) -> tuple[float, float]:
        means = counts @ np.bincount(numbers, squares) / (counts @ sizes)
        low, high = interval(means) or (np.nan, np.nan)
        return _root(low), _root(high)

    return limits


def _root(square: float) -> float:
    """Return the square root with the sign of `square`."""
    return float(np.copysign(np.sqrt(abs(square)), square))
