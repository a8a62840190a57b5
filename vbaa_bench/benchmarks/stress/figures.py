"""Figures of a row: percentages, errors and their intervals by bootstrap over rigs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.benchmarks.stress.rig_results import FrameResult, RigResult
from vbaa_bench.benchmarks.stress.rows import Targets
from vbaa_bench.scoring.statistics import MEDIAN, RMS

# Chosen: the interval limits then scatter by a few per cent of its width.
RESAMPLES: Final = 1000
_CONFIDENCE_PCT: Final = 95.0


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
    resamples = RESAMPLES if len(table) > 1 else 0
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


def _percentage(flags: Floats) -> float:
    return 100 * float(flags.mean()) if len(flags) else np.nan


def _rms(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return RMS.of(finite) if len(finite) else np.nan


def _median(values: Floats) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return MEDIAN.of(finite) if len(finite) else np.nan


_FIGURES: Final[dict[str, Callable[[Floats], float]]] = {
    "answered": lambda frames: _percentage(np.isfinite(frames[:, 0])),
    "rmse": lambda frames: _rms(frames[:, 0]),
    "median": lambda frames: _median(frames[:, 0]),
    "consistent": lambda frames: _percentage(frames[:, 2]),
    "sigma_ratio": lambda frames: _rms(frames[:, 1]) / max(_rms(frames[:, 0]), 1e-12),
    "detected": lambda frames: _percentage(frames[:, 3]),
    "false": lambda frames: _percentage(frames[:, 4]),
}


def _figure(value: float, resampled: Sequence[float]) -> Figure:
    if not np.isfinite(value):
        return Figure(None, None, None)
    finite = np.array([sample for sample in resampled if np.isfinite(sample)])
    if not len(finite):
        return Figure(value, None, None)
    tail = (100 - _CONFIDENCE_PCT) / 2
    low, high = np.percentile(finite, [tail, 100 - tail])
    return Figure(value, float(low), float(high))
