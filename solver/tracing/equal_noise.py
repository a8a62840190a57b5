"""Colour channels in which noise and texture are equally strong and uncorrelated.

The contrast of an edge is then the length of its colour difference, whatever the colours are: wood
differs from a gray table in hue, where a photograph has little noise, and a white beam from a black
table in brightness.
"""

from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats

Image = npt.NDArray[np.float32]

# Distance [px] of the pixels whose differences are compared. Chosen: beyond the blur and the
# subsampled colours of a compressed photograph, which hide the noise of neighbours.
LAG: Final = 4
# Pixels that are compared, and fixed-point steps. Chosen: 1 % of the standard deviations.
SAMPLES, STEPS = 20_000, 20
# Variance of the difference of two rounded values. Derived.
ROUNDING: Final = 2 / 12
# Median of a chi-squared variable of three degrees of freedom.
_CHI2_MEDIAN: Final = 2.366


def equal_noise(image: npt.NDArray[Any]) -> Image:
    """Convert an image (height, width) or (height, width, 3) to channels (height, width, c).

    A gray image, also one of three equal channels, has one channel and is not changed. The unit is
    a gray value: noise and texture have the standard deviation that they have in the mean of the
    channels.
    """
    pixels = np.ascontiguousarray(image, np.float32)
    if pixels.ndim == 2 or np.all(pixels == pixels[..., :1]):
        return pixels.reshape(*pixels.shape[:2], -1)[..., :1]
    differences = _differences(pixels)
    if not len(differences):  # an even image, in which no channel has an edge
        return np.asarray(pixels.mean(axis=2, keepdims=True), np.float32)
    covariance = _covariance(differences)
    values, vectors = np.linalg.eigh(covariance)
    unit = np.sqrt(covariance.mean())  # sigma of the channels' mean
    transform = unit * vectors / np.sqrt(values) @ vectors.T
    return np.asarray(cv2.transform(pixels, transform.astype(np.float32)), np.float32)


def _differences(pixels: Image) -> Floats:
    """Sample differences (n, 3) of pixels along both axes that are not zero."""
    along = (pixels[LAG:] - pixels[:-LAG]).reshape(-1, 3)
    across = (pixels[:, LAG:] - pixels[:, :-LAG]).reshape(-1, 3)
    both = np.concatenate([part[:: max(len(part) // SAMPLES, 1)] for part in (along, across)])
    return np.asarray(both[np.any(both != 0, axis=1)], np.float64)


def _covariance(differences: Floats) -> Floats:
    """Estimate the covariance (3, 3) of differences (n, 3) of which some are those of edges.

    The shape is Tyler's estimate (1987), in which only directions count; the scale is a median.
    """
    shape = np.eye(3)
    for _ in range(STEPS):
        distance = np.einsum("ni,ij,nj->n", differences, np.linalg.inv(shape), differences)
        shape = np.einsum("ni,nj,n->ij", differences, differences, 1 / (distance + 1e-9))
        shape += 1e-6 * np.trace(shape) * np.eye(3)
        shape *= 3 / np.trace(shape)
    distance = np.einsum("ni,ij,nj->n", differences, np.linalg.inv(shape), differences)
    return np.asarray(shape * np.median(distance) / _CHI2_MEDIAN + ROUNDING * np.eye(3))
