"""How much a pixel's gray value scatters: read noise and shot noise, from images of one thing."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from solver.instrument.arrays import Floats, Grey

# Rounding to whole gray values alone has this variance.
ROUNDING = 1 / 12
# Gray values by their mean in so many bins, each of at least so many pixels.
BINS, LEAST_IN_BIN = 24, 40


@dataclass(frozen=True)
class Noise:
    """Variance of a gray value g: `dark` + `per_gray` g, the photon transfer line (EMVA 1288)."""

    dark: float
    per_gray: float

    def variance(self, gray: Floats | float) -> Floats:
        """Variance of gray values, of the same shape."""
        return np.maximum(self.dark + self.per_gray * np.asarray(gray, np.float64), ROUNDING)


def noise_of(images: Sequence[Grey]) -> Noise:
    """The noise of images (height, width) of one and the same thing; one image is enough.

    Of several, a pixel's scatter from image to image is noise. Of one, it is the scatter of a
    pixel about its four neighbours, of which the quieter half is taken: edges are no noise.
    """
    stack = np.stack([np.asarray(image, np.float64) for image in images])
    mean = stack.mean(axis=0)
    if len(images) > 1:
        variance = stack.var(axis=0, ddof=1)
    else:
        inner = stack[0, 1:-1, 1:-1]
        around = stack[0, :-2, 1:-1] + stack[0, 2:, 1:-1] + stack[0, 1:-1, :-2] + stack[0, 1:-1, 2:]
        mean, variance = inner, (inner - around / 4) ** 2 / 1.25
    order = np.argsort(mean, axis=None)
    gray, scatter = mean.ravel()[order], variance.ravel()[order]
    # Bins of equal width: the few bright pixels of a thin beam make the line's far end.
    edges = np.linspace(gray[0], gray[-1] + 1e-9, BINS + 1)
    places = np.searchsorted(gray, edges)
    levels, found, weights = [], [], []
    for first, last in pairwise(places):
        if last - first >= LEAST_IN_BIN:
            levels.append(float(gray[first:last].mean()))
            found.append(_typical(scatter[first:last], len(images)))
            weights.append(last - first)
    floor = ROUNDING if not found else max(found[0], ROUNDING)
    if len(found) < 2:
        return Noise(floor, 0.0)
    # The variance of a variance grows with its square: weights by n over the square.
    weight = np.sqrt(np.array(weights)) / np.maximum(found, ROUNDING)
    slope, dark = np.polyfit(levels, found, 1, w=weight)
    if slope <= 0:
        return Noise(float(np.average(found, weights=weights)), 0.0)
    return Noise(float(dark), float(slope))


def _typical(scatter: Floats, images: int) -> float:
    if images > 1:
        return float(scatter.mean())
    # The median of the square of a normal variable is 0.455 of its mean.
    return float(np.median(scatter) / 0.4549)
