"""Pilot samples: how many samples each pixel of an image needs, from a few samples of some pixels.

They are discarded: reusing them would bias the mean.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask
from vbaa_bench.render.interpolated import Interpolated
from vbaa_bench.render.sample_table import SampleTable
from vbaa_bench.render.tracing import SETS, Quantity, trace
from vbaa_bench.render.world import World

# Samples per set of a pilot.
PILOT_SAMPLES = 4
# Near the beam and at edges between surfaces, every pixel has a pilot of _PILOT_SETS sets; the
# largest variance among its neighbours is used, but in shadows, which are smooth, the mean over
# _SHADOW_WINDOW^2 pixels. Elsewhere one pixel in _PILOT_SPACING^2 has a pilot; _PILOT_WINDOW^2 of
# them are averaged.
_PILOT_SETS, _SHADOW_PILOT_SETS = 4, 2
_SHADOW_WINDOW = 5
_PILOT_SPACING, _PILOT_WINDOW = 4, 5

Noise = Callable[[Floats], Floats]


@dataclass(frozen=True)
class PixelTargets:
    """The noise target of each pixel, as a standard deviation.

    It is `ratio` (height, width) times the sensor's `noise` at the sampled radiance plus `base`
    (height, width). Each pixel of `dense` has its own pilot; the others share pilots. `table`
    corrects the numbers of samples that the pilots predict. The light of one sample must not
    exceed `outlier` times the sensor's noise, if it is stated.
    """

    noise: Noise
    ratio: Floats
    base: Floats
    dense: Mask
    table: SampleTable
    outlier: float | None = None

    def fewest_samples(self, where: Mask) -> Floats:
        """Compute the numbers of samples (n,) per set that keep one sample from being an outlier.

        Pilots cannot tell: where a body hides almost nothing of a lamp, they miss it, and a later
        sample meets it by chance.
        """
        light = self.base[where]
        if self.outlier is None:
            return np.zeros_like(light)
        return np.asarray(light / (SETS * self.outlier * self.noise(light)))


class Pilots(NamedTuple):
    """Ratio (n,) of pixels' variance to the target, and whether (n,) they show the beam.

    `smooth` are the values of those pixels that need not all be rendered.
    """

    excess: Floats
    covered: Mask
    smooth: Interpolated


def pilots(
    world: World, quantity: Quantity, where: Mask, targets: PixelTargets, seed: int
) -> Pilots:
    """Estimate what pixels of `where` need from a few samples of some of them."""
    sampled = where & targets.dense
    sampled[::_PILOT_SPACING, ::_PILOT_SPACING] |= where[::_PILOT_SPACING, ::_PILOT_SPACING]
    rows, columns = np.nonzero(sampled)
    pixels, size = np.column_stack([columns, rows]), np.full(len(rows), PILOT_SAMPLES)
    sets = _SHADOW_PILOT_SETS if quantity == "change" else _PILOT_SETS
    traced = trace(world, pixels, size, seed, quantity, sets)
    sigma = targets.ratio[sampled] * targets.noise(targets.base[sampled] + traced.radiance)
    # Variance for SETS sets instead of the pilot's.
    excess = sets / SETS * traced.variance / np.maximum(sigma**2, 1e-30)
    image = np.zeros(where.shape, np.float32)
    image[sampled] = excess
    fine = _mean(image, sampled, _SHADOW_WINDOW if quantity == "change" else 3)
    # The variance at edges does not apply to the smooth parts beside them.
    every = slice(None, None, _PILOT_SPACING)
    grid, known = image[every, every], sampled[every, every]
    alone = known & ~targets.dense[every, every]
    coarse = np.where(
        dilated(alone, _PILOT_WINDOW // 2),
        _mean(grid, alone, _PILOT_WINDOW),
        _mean(grid, known, _PILOT_WINDOW),
    )
    coarse = _enlarged(coarse, where.shape)
    local = fine if quantity == "change" else cv2.dilate(fine, np.ones((3, 3), np.uint8))
    covered = np.zeros(where.shape, np.bool_)
    covered[sampled] = traced.coverage > 0
    excess = np.maximum(np.where(targets.dense, local, coarse)[where], 0)
    smooth = Interpolated.nothing(len(excess))
    if quantity == "change":
        values, deviations = np.zeros((2, *where.shape), np.float32)
        values[sampled], deviations[sampled] = traced.radiance, sigma
        smooth = Interpolated.between(
            values[every, every], known, deviations[every, every], _PILOT_SPACING, where
        )
    return Pilots(excess, covered[where], smooth)


def _mean(image: np.ndarray, known: Mask, window: int) -> np.ndarray:
    """Average the `known` pixels of an image in a window about each pixel; 0 without any."""
    count = cv2.blur(known.astype(np.float32), (window, window))
    total = cv2.blur(np.where(known, image, np.float32(0)), (window, window))
    return np.asarray(total / np.maximum(count, window**-2))


def _enlarged(grid: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Give each pixel of an image (height, width) of `shape` the value of its place in a grid."""
    rows, columns = (np.arange(size) // _PILOT_SPACING for size in shape)
    return np.asarray(grid[rows[:, None], columns])


def dilated(mask: Mask, pixels: int) -> Mask:
    """Add to a mask (height, width) all pixels within a square of `pixels` on each side."""
    kernel = np.ones((2 * pixels + 1, 2 * pixels + 1), np.uint8)
    return cv2.dilate(mask.astype(np.uint8), kernel) > 0
