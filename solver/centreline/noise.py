"""Noise of a pixel's gray value, read noise and shot noise, from images of one scene."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit

# Rounding to whole gray values alone has this variance.
ROUNDING = 1 / 12
# Number of bins of the mean gray value, and fewest pixels in each.
BINS, MIN_IN_BIN = 24, 40
# Mean of the lower three quarters of the smaller of both squared deviations, for white noise of
# unit variance, by simulation.
MEAN_OF_SMALLER = 0.2149


class Noise(NamedTuple):
    """Variance of a gray value g: `dark` + `per_gray` g, the photon transfer line (EMVA 1288)."""

    dark: float
    per_gray: float

    def variance(self, gray: Floats | float) -> Floats:
        """Compute the variance of gray values, of the same shape."""
        return np.maximum(self.dark + self.per_gray * np.asarray(gray, np.float64), ROUNDING)

    def processed(self, image: Grey) -> bool:
        """Return whether images like this one (height, width) were compressed or denoised."""
        return bool(np.median(self.variance(image.astype(np.float64))) < THRESHOLDS.min_noise**2)


@njit(inline="always")
def pixel_variance(noise: Noise, gray: float) -> float:
    """Compute the variance of a pixel's gray value."""
    return float(max(noise.dark + noise.per_gray * gray, ROUNDING))


def estimate_noise(images: Sequence[Grey]) -> Noise:
    """Estimate the noise from images (height, width) of one scene; one is enough.

    With several images, the noise is a pixel's scatter from image to image, after division by each
    image's overall brightness, which flickers. With one, it is the smaller of a pixel's deviations
    from its neighbours in its row and in its column, so that edges do not count as noise.
    """
    if len(images) > 1:
        mean, variance = _over_images(images)
    else:
        (image,) = (np.asarray(image, np.float64) for image in images)
        pixel = image[1:-1, 1:-1]
        beside, above = image[1:-1, :-2] + image[1:-1, 2:], image[:-2, 1:-1] + image[2:, 1:-1]
        variance = np.minimum((pixel - beside / 2) ** 2, (pixel - above / 2) ** 2)
        # The noise of this mean is independent of that of both deviations. Sorted by their own
        # value, pixels of one brightness would deviate least where they are in the middle.
        mean = (pixel + beside + above) / 5
    order = np.argsort(mean, axis=None)
    gray, scatter = mean.ravel()[order], variance.ravel()[order]
    # Bins of equal width: the few bright pixels of a thin beam determine the line's far end.
    edges = np.linspace(gray[0], gray[-1] + 1e-9, BINS + 1)
    bounds = np.searchsorted(gray, edges)
    levels, variances, weights = [], [], []
    for first, last in pairwise(bounds):
        if last - first >= MIN_IN_BIN:
            levels.append(float(gray[first:last].mean()))
            variances.append(_mean_variance(scatter[first:last], len(images)))
            weights.append(last - first)
    if not variances:
        return Noise(ROUNDING, 0.0)
    # The variance of a variance grows with its square: the weights are n over the square. The
    # line's slope, and its value at the darkest gray value, are at least 0; below the darkest gray
    # value, under the camera's black level, the line may be negative.
    weight = np.sqrt(np.array(weights)) / np.maximum(variances, ROUNDING)
    # With one image, remaining edges steepen the line: it then starts at gray value 0.
    black = gray[0] if len(images) > 1 else 0.0
    design = np.column_stack([np.ones(len(levels)), np.array(levels) - black])
    (darkest, per_gray), _ = nnls(design * weight[:, None], np.array(variances) * weight)
    return Noise(float(darkest - per_gray * black), float(per_gray))


def _over_images(images: Sequence[Grey]) -> tuple[Floats, Floats]:
    """Compute mean and variance (height, width) of several images, less changes of brightness.

    Images are read one by one: as one array of floats, twelve of 12 megapixels would take a
    gigabyte.
    """
    n, mean = len(images), mean_image(images)
    deviations, squares = np.zeros(mean.shape), np.zeros(mean.shape)
    for image in images:
        deviation = deviation_from(mean, image)
        deviations += deviation
        squares += deviation * deviation
    return mean, (squares - deviations * deviations / n) / (n - 1)


def mean_image(images: Sequence[Grey]) -> Floats:
    """Average images (height, width), which are read one by one."""
    mean = np.zeros(images[0].shape)
    for image in images:
        mean += image
    return mean / len(images)


def deviation_from(mean: Floats, image: Grey) -> Floats:
    """Compute the deviation (height, width) from the mean image, less a change of brightness."""
    total = max(float(np.einsum("hw,hw->", mean, mean)), 1e-12)
    brightness = max(float(np.einsum("hw,hw->", image, mean)) / total, 1e-6)
    return np.asarray(image / brightness - mean)


def _mean_variance(scatter: Floats, n_images: int) -> float:
    if n_images > 1:
        return float(scatter.mean())
    # The lower three quarters only: at a corner both deviations contain an edge.
    return float(np.sort(scatter)[: 3 * len(scatter) // 4].mean() / MEAN_OF_SMALLER)
