"""Axes of charts: linear, logarithmic, or signed with a logarithmic scale to both sides."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from solver.instrument.arrays import Floats

_STEPS = (1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Axis:
    """Axis from `low` to `high`.

    A "signed" axis is symmetric, asinh(value / unit): linear far below `unit`, logarithmic above.
    """

    label: str
    low: float
    high: float
    kind: Literal["linear", "log", "signed"] = "linear"
    unit: float = 1.0

    def share(self, values: Floats | float) -> Floats:
        """Compute the places of values along the axis, 0 at `low` and 1 at `high`; clipped."""
        low, high, places = (
            self._scaled(np.asarray(each)) for each in (self.low, self.high, values)
        )
        return np.asarray(np.clip((places - low) / (high - low), 0, 1), np.float64)

    def _scaled(self, values: Floats) -> Floats:
        if self.kind == "log":
            return np.log(np.maximum(values, 1e-300))
        return np.arcsinh(values / self.unit) if self.kind == "signed" else values

    def ticks(self) -> list[float]:
        """Choose round values: three to seven, those of a logarithmic axis in decades."""
        if self.kind == "linear":
            return _linear_ticks(self.low, self.high)
        if self.kind == "log":
            return _log_ticks(self.low, self.high)
        powers = [10.0**n for n in range(-9, 10) if 10.0**n <= self.high]
        # Labels of a chart with 150 px are then at least 15 px apart.
        apart = [power for power in powers if self.share(power) > 0.6]
        powers = apart[:: -(-len(apart) // 3)] if apart else [self.high]
        return [*(-power for power in reversed(powers)), 0.0, *powers]


def _linear_ticks(low: float, high: float) -> list[float]:
    rough = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(rough))
    step = next((power * s for s in _STEPS if power * s >= rough), 10 * power)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(round(n * step, 12)) + 0.0 for n in np.arange(first, last + 1)]


def _log_ticks(low: float, high: float) -> list[float]:
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    coarse = [10.0**n for n in decades if low <= 10.0**n * 1.0001 and 10.0**n <= high * 1.0001]
    if len(coarse) >= 3:
        return coarse[:: -(-len(coarse) // 7)]
    fine = [s * 10.0**n for n in decades for s in _STEPS if low <= s * 10.0**n <= high]
    return fine or [low, high]


def log_axis(label: str, values: Floats, margin: float = 1.6) -> Axis:
    """Make a logarithmic axis of positive values, with a margin of this factor to both sides."""
    positive = values[(values > 0) & np.isfinite(values)]
    if not len(positive):
        return Axis(label, 0.1, 10.0, "log")
    return Axis(label, float(positive.min()) / margin, float(positive.max()) * margin, "log")


def signed_axis(label: str, values: Floats, small: float) -> Axis:
    """Make a symmetric axis of signed values, logarithmic above the decade of `small`."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if len(finite) and finite.max() > 0 else 1.0
    unit = 10.0 ** np.floor(np.log10(small if 0 < small < largest else largest / 10))
    return Axis(label, -1.15 * largest, 1.15 * largest, "signed", float(unit))
