"""Period of the grid on which images were processed, from the noise of images of one scene.

A sensor's noise is white and the same in all pixels of a gray value. A colour mosaic, a change of
size and the blocks of a compression average some pixels more than others: the noise that is left is
correlated, and its variance repeats with their grid. What differs from image to image shows the
grid, wherever the beam is.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.centreline.noise import Noise, deviation_from, mean_image
from solver.instrument.arrays import Floats, Grey

# Longest period [px]. Derived: the blocks of JPEG and of videos have 8 pixels.
_LONGEST: Final = 8
# Correlation of neighbouring pixels' noise, above which images are processed. Measured: on images
# of a sensor it was at most 0.002; demosaiced, compressed, denoised or resized, at least 0.085.
_MAX_CORRELATION: Final = 0.03
# A pixel's squared deviation counts up to this many variances. Chosen: moving shadows exceed it.
_MAX_SQUARE: Final = 10.0


def grid_period(images: Sequence[Grey], noise: Noise) -> int:
    """Estimate the period [px] of the grid on which images (height, width) were processed.

    It is 0 for images as a sensor takes them, and for a single image, which does not show it; 1 for
    processed ones without a longer period.
    """
    if len(images) < 2:
        return 0
    mean = mean_image(images)
    sigma = np.sqrt(noise.variance(mean))
    squares, rows, columns = np.zeros(mean.shape), 0.0, 0.0
    for image in images:
        deviation = deviation_from(mean, image) / sigma
        squares += deviation * deviation
        rows += float(np.mean(deviation[:, 1:] * deviation[:, :-1]))
        columns += float(np.mean(deviation[1:] * deviation[:-1]))
    typical = float(squares.mean())
    if max(rows, columns) <= _MAX_CORRELATION * typical:
        return 0
    squares = np.minimum(squares, _MAX_SQUARE * typical)
    gain = {period: _gain(squares, period) for period in range(2, _LONGEST + 1)}
    period = max(gain, key=lambda one: gain[one])
    return period if gain[period] > 0 else 1


def _gain(squares: Floats, period: int) -> float:
    """Compute twice the log likelihood gained by means of values (height, width) over a period.

    The number of means costs as much as in the Bayesian information criterion (Schwarz 1978).
    """
    height, width = squares.shape[0] // period, squares.shape[1] // period
    if not (height and width):
        return 0.0
    cells = squares[: height * period, : width * period].reshape(height, period, width, period)
    variance = max(float(cells.var()), 1e-300) / (height * width)
    chi2 = float(cells.mean(axis=(0, 2)).var()) * period**2 / variance
    return float(chi2 - period**2 * math.log(squares.size))
