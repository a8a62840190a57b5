"""Test whether anything moved between rest images, from their gray values about the beam.

Where the beam hardly differs from the ground, its centre is wherever noise puts it, and images in
which nothing moved show it in different places. Their gray values then differ by noise alone.
"""

import math
from collections.abc import Sequence

import numpy as np

from solver.at_rest.thresholds import THRESHOLDS
from solver.centreline import Centreline
from solver.instrument.arrays import Floats, Grey

# Terms of the motion along the beam, as in `rest_line.disagreements`.
_TERMS = 4
# Pixels beside the beam's edges that are compared. Chosen: a blurred edge is that wide.
_MARGIN_PX = 3


def moved(images: Sequence[Grey], lines: Sequence[Centreline], radius_px: float) -> bool:
    """Return whether the beam or the camera moved between images (height, width) of a beam at rest.

    `lines` are the beam's centrelines as found in the images, each of at least `min_points`. The
    difference of an image from the mean of all is fitted, along its line, by a smooth motion: the
    mean's gradient across the beam, times a cubic of the place along the beam. Changes of
    brightness are fitted, too. The motion counts if it is significant and large enough, both as
    for the places of the lines.
    """
    mean = np.mean([np.asarray(image, np.float64) for image in images], axis=0)
    half = math.ceil(2 * radius_px) + _MARGIN_PX
    return any(
        _significant(np.asarray(image, np.float64) - mean, mean, line, half)
        for image, line in zip(images, lines, strict=True)
    )


def _significant(difference: Floats, mean: Floats, line: Centreline, half: int) -> bool:
    """Return whether a difference (height, width) from the mean image is that of a motion."""
    along = np.rint(line.directions).astype(np.int64)
    centre = np.rint(line.points).astype(np.int64)
    # Pixels (n, 2 half + 1, 2) across the beam, those at the border with their own neighbours.
    pixels = centre[:, None] + along[:, None] * np.arange(-half, half + 1)[:, None]
    highest = np.array(mean.shape[::-1]) - 1
    values, before, after = (
        mean[tuple(np.clip(pixels + step * along[:, None], 0, highest).T[::-1])].T
        for step in (0, -1, 1)
    )
    changes = difference[tuple(np.clip(pixels, 0, highest).T[::-1])].T
    shape = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, len(centre)), _TERMS - 1)
    gradient = (after - before) / 2
    motion = -(gradient[..., None] * shape[:, None]).reshape(-1, _TERMS)
    light = np.column_stack([values.ravel(), np.ones(values.size)])
    design = np.column_stack([motion, light])
    inverse = np.linalg.pinv(design.T @ design)
    solution = inverse @ design.T @ changes.ravel()
    residual = changes.ravel() - design @ solution
    variance = max(float(np.mean(residual**2)), 1e-12)
    coefficients = solution[:_TERMS]
    chi2 = coefficients @ np.linalg.pinv(inverse[:_TERMS, :_TERMS]) @ coefficients / variance
    largest = np.abs(shape @ coefficients).max()
    return bool(chi2 > THRESHOLDS.disagreement_chi2 and largest > THRESHOLDS.disagreement_px)
