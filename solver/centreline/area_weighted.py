"""Area-weighted average of the paper's Fig. 15: the beam's centre in every image column.

In a column, the pixels brighter than a threshold belong to the beam, and their mean row, weighted
by pixel coverage, is its centre. Coverage follows from the gray value:
(gray - background) / (beam - background). Discarding the faint flanks biases the centre with the
period of one pixel (S-curve). That error is part of the method; its size is estimated from the
flanks' contribution, and is included in each sigma.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np

from solver.centreline import Centreline, down_columns
from solver.centreline.appearance import shading_weight
from solver.centreline.guide import Guide
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError

# Smallest sigma [px] of a point: drawn images may have neither noise nor flanks. Chosen.
MIN_SIGMA_PX: Final = 1e-3


@dataclass(frozen=True)
class AreaWeighted:
    """The paper's extractor, which learns nothing but the weight of the beam's own shading.

    The threshold changes that weight by less than its uncertainty. Computed for beams 1.6 to 6 px
    wide with a blur of 0.3 to 1 px: by factors of 0.94 to 1.18.
    """

    shading: float
    detector: None = None

    def __call__(self, image: Grey) -> Centreline:
        """Extract the centreline of an image (height, width); empty where there is no beam."""
        return area_weighted(image)


def learn_area_weighted(images: Sequence[Grey], guide: Guide) -> AreaWeighted:
    """Learn the weight of the beam's shading from images (height, width) of it at rest.

    Raises InputError where they do not show a bright beam that runs from left to right.
    """
    bands = [_band(image) for image in images] if guide.scans_columns else []
    if not bands or not all(len(band.columns) for band in bands):
        raise InputError(
            "the rest images show no bright beam that runs from left to right, "
            "as area_weighted requires"
        )
    amplitude = float(np.median([np.median(band.cover.sum(axis=0)) for band in bands]))
    ground = float(np.median([np.median(band.background) for band in bands]))
    return AreaWeighted(shading_weight(amplitude, guide.radius_px, ground))


def area_weighted(image: Grey) -> Centreline:
    """Extract the centreline of a bright beam from left to right in `image` (height, width).

    Columns in which no beam is detected are absent. The result is empty if there is none.
    """
    band = _band(image)
    if not len(band.columns):
        return down_columns(np.empty((0, 2)), np.empty(0))
    rows, inside, cover, gray = band.rows, band.inside, band.cover, band.gray
    centre, area = _mean_row(rows, np.where(inside, cover, 0.0))
    flanks = cv2.dilate(inside.astype(np.uint8), np.ones((3, 1), np.uint8)) > 0
    with_flanks, _ = _mean_row(rows, np.where(flanks, cover, 0.0))
    s_curve = _clipped_rms(with_flanks - centre)
    # d centre / d gray = (row - centre) / area; the variance of gray grows like shot noise.
    relative_variance = np.maximum(gray, 1.0) / np.maximum(band.background, 1.0)
    gradient = np.where(inside, rows - centre, 0.0) / area
    variance = (gradient**2 * relative_variance).sum(axis=0) * band.noise**2
    points = np.column_stack([band.columns, band.top + centre])
    return down_columns(points, np.maximum(np.sqrt(variance + s_curve**2), MIN_SIGMA_PX))


class _Band(NamedTuple):
    """Image `columns` (n,) that show the beam, and windows about it.

    `rows` (m, n) of the windows are counted from the image row `top`; `inside` (m, n) marks the
    pixels that belong to the beam; `gray` (m, n) are their values, `cover` (m, n) those above the
    column's `background` (n,), which has the standard deviation `noise` (n,).
    """

    columns: np.ndarray
    top: int
    rows: np.ndarray
    inside: np.ndarray
    gray: Floats
    cover: Floats
    background: Floats
    noise: Floats


def _band(image: Grey) -> _Band:
    """Find the beam in an image (height, width); without columns where there is none."""
    background, noise = _background(image)
    contrast = image.max(axis=0) - background
    visible = contrast > np.maximum(
        THRESHOLDS.area_contrast * np.quantile(contrast, 0.9), THRESHOLDS.area_sigmas * noise
    )
    # Columns without a beam: the threshold is their brightest pixel, which none exceeds.
    threshold = np.where(
        visible, background + THRESHOLDS.area_level * contrast, background + contrast
    )
    crop, band = _longest_band(image > threshold.astype(image.dtype))
    height = np.count_nonzero(band, axis=0)
    columns = np.flatnonzero(visible & (height > 0) & (height <= THRESHOLDS.area_width_px))
    rows = _window(np.argmax(band[:, columns], axis=0), len(band))
    gray = image[crop][rows, columns].astype(np.float64)
    return _Band(
        columns,
        crop.start,
        rows,
        band[rows, columns],
        gray,
        gray - background[columns],
        background[columns],
        noise[columns],
    )


def _background(image: Grey) -> tuple[Floats, Floats]:
    """Estimate median and standard deviation of each column, by quartiles: robust to the beam."""
    # Every fourth row is as accurate as all of them, and faster.
    sample = image[::4]
    last = len(sample) - 1
    middle = [last // 2, (last + 1) // 2]
    ranks = [last // 4, *middle, last - last // 4]
    low, *medians, high = np.partition(sample, ranks, axis=0)[ranks].astype(np.float64)
    return np.mean(medians, axis=0), (high - low) / 1.349 + 0.3  # 0.3: rounding


def _longest_band(above: np.ndarray) -> tuple[slice, np.ndarray]:
    """Find the connected region that spans the most columns: the beam, not a glint beside it.

    Return the image rows about it, and the mask of its pixels in them.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(above.astype(np.uint8))
    if count <= 1:
        return slice(0, len(above)), above
    longest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_WIDTH]))
    top, height = stats[longest, [cv2.CC_STAT_TOP, cv2.CC_STAT_HEIGHT]]
    crop = slice(max(top - THRESHOLDS.area_width_px, 0), top + height + THRESHOLDS.area_width_px)
    return crop, np.asarray(labels[crop] == longest)


def _window(first: np.ndarray, height: int) -> np.ndarray:
    """Return rows (n, columns) of windows that start two pixels above a band's first row."""
    size = min(THRESHOLDS.area_width_px + 4, height)
    top = np.clip(first - 2, 0, height - size)
    return np.asarray(top + np.arange(size)[:, None])


def _clipped_rms(shift: Floats) -> float:
    """Compute the RMS of shifts (n,); clip the largest twentieth, which may be outliers."""
    size = np.abs(shift)
    return float(np.sqrt(np.mean(np.minimum(size, np.quantile(size, 0.95)) ** 2)))


def _mean_row(rows: np.ndarray, weight: Floats) -> tuple[Floats, Floats]:
    area = weight.sum(axis=0)
    return (rows * weight).sum(axis=0) / area, area
