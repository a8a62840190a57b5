"""Shutter and flickering light: the weight of each moment in each row of an image.

A rolling shutter exposes the rows one after another. The light that a row receives is the integral
of a radiance that varies in time, because the scene moves and because the lamps flicker.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats


class Flicker(NamedTuple):
    """Relative light power 1 + `depth` cos(`frequency` t + `phase`), frequency in [rad/s]."""

    depth: float
    frequency: float
    phase: float

    def integral(self, times: Floats) -> Floats:
        """Compute the antiderivative [s] of the power at some times [s]."""
        angle = self.frequency * times + self.phase
        return np.asarray(times + self.depth * np.sin(angle) / self.frequency)

    def double_integral(self, times: Floats) -> Floats:
        """Compute the antiderivative [s^2] of `integral`."""
        angle = self.frequency * times + self.phase
        return np.asarray(times**2 / 2 - self.depth * np.cos(angle) / self.frequency**2)


# Constant light; its frequency is any number but zero.
STEADY = Flicker(depth=0.0, frequency=1.0, phase=0.0)


@dataclass(frozen=True)
class Shutter:
    """Each of `rows` rows is exposed for `exposure` [s], `line_time` [s] after the row above it.

    Time zero is the middle of the exposure of the image's middle.
    """

    exposure: float
    line_time: float
    rows: int

    @property
    def span(self) -> float:
        """Time [s] from the start of the first exposure to the end of the last one."""
        return self.exposure + self.line_time * (self.rows - 1)

    def weights(self, poses: int, light: Flicker = STEADY) -> Floats:
        """Compute the weights (rows, poses) of a frame's poses in each of its rows.

        The poses are at equal intervals from the start of the first exposure to the end of the
        last one. Between two of them, radiance at constant light is interpolated linearly; the
        product with the light's power is integrated in closed form. The error is of second order
        in the interval. The sum over the poses is the mean power that a row sees, for constant
        light 1.
        """
        readout = self.span - self.exposure
        middle = np.linspace(-readout / 2, readout / 2, self.rows)
        starts, ends = middle - self.exposure / 2, middle + self.exposure / 2
        if poses == 1:
            received = light.integral(ends) - light.integral(starts)
            return np.asarray(received[:, None] / self.exposure)
        nodes = np.linspace(-self.span / 2, self.span / 2, poses)
        interval = self.span / (poses - 1)
        # Part of each interval (rows, poses - 1) in which a row is exposed; may be empty.
        start = np.clip(starts[:, None], nodes[:-1], nodes[1:])
        end = np.clip(ends[:, None], nodes[:-1], nodes[1:])
        whole = light.integral(end) - light.integral(start)
        # Integration by parts of the light times the fraction (t - node) / interval.
        later = (end - nodes[:-1]) * light.integral(end)
        later -= (start - nodes[:-1]) * light.integral(start)
        later -= light.double_integral(end) - light.double_integral(start)
        later /= interval
        weights = np.zeros((self.rows, poses))
        weights[:, 1:] += later
        weights[:, :-1] += whole - later
        return weights / self.exposure


def effective_count(weights: Floats) -> float:
    """Compute the number of equally weighted poses with as much averaging as the worst row."""
    shares = weights / weights.sum(axis=1, keepdims=True)
    return float(1 / (shares**2).sum(axis=1).max())
