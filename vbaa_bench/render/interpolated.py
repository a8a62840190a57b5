"""A smooth image that is interpolated between pilots, and corrected at random pixels.

Where shadows are smooth, interpolation from sparse pilots is nearly right. One pixel in several is
rendered; its difference from the interpolated value, divided by the probability that it was chosen,
is added to it. The mean is unbiased, whatever the pilots are.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask

# Smallest probability that a pixel is rendered. Chosen: the rendered ones then depart by at most
# three times the target noise.
_SMALLEST = 1 / 4
# The largest error of _RARE^2 pilots counts. Chosen: an edge of a shadow that a pilot meets only by
# chance is met by a neighbour.
_RARE = 5
# Steps of the pattern of chosen pixels along columns and rows: those of the R sequence in two
# dimensions (Roberts 2018), whose thresholds are even in every neighbourhood.
_STEPS = (0.7548776662466927, 0.5698402909980532)
# Weights of a pilot's neighbours.
_NEIGHBOURS = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4
# A weight of known pilots above this is one of known pilots alone, up to rounding.
_ALL = 1 - 1e-4


class Correction(NamedTuple):
    """Radiance (n,) of pixels, and its variance (n,)."""

    radiance: Floats
    variance: Floats


@dataclass(frozen=True)
class Interpolated:
    """Values (n,) of pixels, and the probability (n,) that a pixel is rendered.

    A pixel of probability 1 is always rendered; its value does not count.
    """

    value: Floats
    probability: Floats

    @classmethod
    def nothing(cls, count: int) -> Self:
        """Return pixels that are all rendered."""
        return cls(np.zeros(count), np.ones(count))

    @classmethod
    def between(
        cls, values: np.ndarray, known: Mask, sigma: np.ndarray, spacing: int, where: Mask
    ) -> Self:
        """Interpolate the pixels of `where` (height, width) between pilots `spacing` pixels apart.

        `values` of the pilots (rows, columns) are `known` in part; `sigma` (rows, columns) is the
        target noise. Pixels whose pilots, or those next to them, are not all known are rendered.
        """
        values, has = np.where(known, values, np.float32(0)), known.astype(np.float32)
        around, complete = (
            cv2.filter2D(image, -1, _NEIGHBOURS, borderType=cv2.BORDER_REPLICATE)
            for image in (values, has)
        )
        complete = (has * complete > _ALL).astype(np.float32)
        # A pilot is predicted from others that are farther away than a pixel's: by more.
        error = complete * (values - around) ** 2 / np.where(known, sigma, 1) ** 2
        largest = cv2.dilate(error, np.ones((_RARE, _RARE), np.uint8))
        value, needed, complete = (
            _enlarged(image, spacing, where.shape)[where] for image in (values, largest, complete)
        )
        probability = np.where(complete > _ALL, np.clip(needed, _SMALLEST, 1), 1)
        return cls(value.astype(np.float64), probability)

    def rendered_if(self, needed: Mask) -> Self:
        """Return the same with all pixels of `needed` (n,) rendered."""
        return replace(self, probability=np.where(needed, 1, self.probability))

    def chosen(self, rows: np.ndarray, columns: np.ndarray, seed: int) -> Mask:
        """Choose which of the pixels (n,) are rendered."""
        shift = np.random.default_rng(seed).random()
        return (shift + _STEPS[0] * columns + _STEPS[1] * rows) % 1 < self.probability

    def corrected(self, chosen: np.ndarray, radiance: Floats, variance: Floats) -> Correction:
        """Compute radiance and variance of `chosen` pixels (m,) from what was rendered there."""
        p, value = self.probability[chosen], np.where(self.probability < 1, self.value, 0)[chosen]
        difference = radiance - value
        squared = (1 - p) * difference**2 + p * variance
        return Correction(value + difference / p, squared / p**2)


def _enlarged(image: np.ndarray, factor: int, shape: tuple[int, ...]) -> np.ndarray:
    """Interpolate an image (height, width) of `shape` from every `factor`-th row and column."""
    transform = np.array([[1 / factor, 0, 0], [0, 1 / factor, 0]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    large = cv2.warpAffine(
        image, transform, shape[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(large)
