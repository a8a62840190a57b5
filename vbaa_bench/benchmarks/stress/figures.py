"""Figures of a row: percentages, errors and their intervals by bootstrap over rigs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.benchmarks.stress.rig_results import FrameResult, RigResult
from vbaa_bench.benchmarks.stress.rows import Targets
from vbaa_bench.scoring.bootstrap import DRAWS, interval
from vbaa_bench.scoring.statistics import MEAN, MEDIAN, RMS, Reduction


@dataclass(frozen=True)
class Figure:
    """Value with its 95 % interval; each is None if it cannot be computed.

    A single rig has no interval.
    """

    value: float | None
    low: float | None
    high: float | None


def figures(rigs: Sequence[RigResult], seed: int) -> dict[str, Figure]:
    """Compute a row's figures over all frames of all rigs.

    Figures in % of frames are answered, consistent, detected and false. Figures of the answered
    frames in % of L are rmse and median. sigma_ratio is the RMS of the stated sigmas over the
    RMSE.
    """
    table = [_frame_rows(rig.frames) for rig in rigs]
    random = np.random.default_rng(seed)
    resamples = DRAWS if len(table) > 1 else 0
    picks = random.integers(len(table), size=(resamples, len(table)))
    resampled = [np.vstack([table[index] for index in row]) for row in picks]
    all_frames = np.vstack(table)
    return {
        name: _figure(compute(all_frames), [compute(frames) for frames in resampled])
        for name, compute in _FIGURES.items()
    }


def missed(found: dict[str, Figure], wanted: Targets) -> tuple[str, ...]:
    """List the names of the target figures that the values do not reach."""
    upper = {"rmse": "rmse", "sigma_ratio": "sigma_ratio", "alarmed": "detected", "false": "false"}
    names = []
    for name, bound in wanted.record().items():
        value = found[upper.get(name, name)].value
        if value is None or (value > bound if name in upper else value < bound):
            names.append(name)
    return tuple(names)


def _frame_rows(frames: Sequence[FrameResult]) -> Floats:
    """Make rows (n, 5): error, sigma [% of L, NaN if missing], consistent, detected, false."""
    rows = [
        (
            np.nan if frame.error_pct is None else frame.error_pct,
            np.nan if frame.sigma_pct is None else frame.sigma_pct,
            frame.consistent,
            frame.detected,
            frame.false,
        )
        for frame in frames
    ]
    return np.array(rows, dtype=float).reshape(-1, 5)


def _of(reduction: Reduction, values: Floats) -> float:
    """Reduce the values that are not missing; NaN if there is none."""
    known = values[~np.isnan(values)]
    return reduction.of(known) if len(known) else np.nan


_FIGURES: Final[dict[str, Callable[[Floats], float]]] = {
    "answered": lambda frames: 100 * _of(MEAN, ~np.isnan(frames[:, 0])),
    "rmse": lambda frames: _of(RMS, frames[:, 0]),
    "median": lambda frames: _of(MEDIAN, np.abs(frames[:, 0])),
    "consistent": lambda frames: 100 * _of(MEAN, frames[:, 2]),
    "sigma_ratio": lambda frames: _of(RMS, frames[:, 1]) / max(_of(RMS, frames[:, 0]), 1e-12),
    "detected": lambda frames: 100 * _of(MEAN, frames[:, 3]),
    "false": lambda frames: 100 * _of(MEAN, frames[:, 4]),
}


def _figure(value: float, resampled: Sequence[float]) -> Figure:
    if not np.isfinite(value):
        return Figure(None, None, None)
    return Figure(value, *(interval(np.array(resampled)) or (None, None)))
