"""The area-weighted average of the paper's Fig. 15: the beam's centre in every image column.

In a column, the pixels brighter than a threshold belong to the beam, and their mean row,
weighted by how much of each the beam covers, is its centre. Cover is read off the gray
value: (gray - background) / (beam - background). Cutting the faint flanks off makes the
centre follow the pixel grid a little (an S-curve of period one pixel). That error is part of
the method; its size is seen from what the flanks would have added, and goes into each sigma.
"""

import cv2
import numpy as np

from solver.centreline import Centreline, down_columns
from solver.instrument.arrays import Floats, Grey

# Of the contrast between beam and background: low enough to keep the flanks of a line two
# pixels wide, high enough to leave a dark object beside it out.
THRESHOLD = 0.25
# A column shows the beam if its brightest pixel stands out by this share of the whole image's
# contrast and by this many sigmas of its background.
LEAST_CONTRAST = 0.5
LEAST_SIGNIFICANCE = 8.0
# A wider band is something else; a window of this and four rows more holds it and its flanks.
WIDEST_PX = 12


def area_weighted(image: Grey) -> Centreline:
    """The centreline of the bright beam that runs from left to right in `image` (height, width).

    Columns in which no beam stands out are absent. Empty if there is none at all.
    """
    background, noise = _background(image)
    contrast = image.max(axis=0) - background
    seen = contrast > np.maximum(
        LEAST_CONTRAST * np.quantile(contrast, 0.9), LEAST_SIGNIFICANCE * noise
    )
    nothing = down_columns(np.empty((0, 2)), np.empty(0))
    if not seen.any():
        return nothing
    # Columns without a beam: nothing is above their brightest pixel.
    least = np.where(seen, background + THRESHOLD * contrast, background + contrast)
    about, band = _longest_band(image > least.astype(image.dtype))
    height = np.count_nonzero(band, axis=0)
    columns = np.flatnonzero(seen & (height > 0) & (height <= WIDEST_PX))
    if not len(columns):
        return nothing
    rows = _window(np.argmax(band[:, columns], axis=0), len(band))
    inside = band[rows, columns]
    gray = image[about][rows, columns].astype(np.float64)
    cover = gray - background[columns]

    centre, area = _mean_row(rows, np.where(inside, cover, 0.0))
    flanks = cv2.dilate(inside.astype(np.uint8), np.ones((3, 1), np.uint8)) > 0
    whole, _ = _mean_row(rows, np.where(flanks, cover, 0.0))
    s_curve = _typical(whole - centre)
    # d centre / d gray = (row - centre) / area; the variance of gray grows as that of shots does.
    shots = np.maximum(gray, 1.0) / np.maximum(background[columns], 1.0)
    lever = np.where(inside, rows - centre, 0.0) / area
    variance = (lever**2 * shots).sum(axis=0) * noise[columns] ** 2
    points = np.column_stack([columns, about.start + centre])
    return down_columns(points, np.sqrt(variance + s_curve**2))


def _background(image: Grey) -> tuple[Floats, Floats]:
    """Median and standard deviation of each column, by quartiles: the beam does not count."""
    # Every fourth row tells as well as all of them, and sooner.
    some = image[::4]
    last = len(some) - 1
    middle = [last // 2, (last + 1) // 2]
    at = [last // 4, *middle, last - last // 4]
    low, *medians, high = np.partition(some, at, axis=0)[at].astype(np.float64)
    return np.mean(medians, axis=0), (high - low) / 1.349 + 0.3  # 0.3: rounding


def _longest_band(above: np.ndarray) -> tuple[slice, np.ndarray]:
    """The connected region that spans the most columns: the beam, not a glint beside it.

    The image's rows about it, and which of their pixels belong to it.
    """
    count, labels, found, _ = cv2.connectedComponentsWithStats(above.astype(np.uint8))
    if count <= 1:
        return slice(0, len(above)), above
    longest = 1 + int(np.argmax(found[1:, cv2.CC_STAT_WIDTH]))
    top, height = found[longest, [cv2.CC_STAT_TOP, cv2.CC_STAT_HEIGHT]]
    about = slice(max(top - WIDEST_PX, 0), top + height + WIDEST_PX)
    return about, np.asarray(labels[about] == longest)


def _window(first: np.ndarray, height: int) -> np.ndarray:
    """Rows (n, columns) of a window that starts two pixels above a band's first row."""
    size = min(WIDEST_PX + 4, height)
    top = np.clip(first - 2, 0, height - size)
    return np.asarray(top + np.arange(size)[:, None])


def _typical(shift: Floats) -> float:
    """Root mean square of shifts (n,); the largest twentieth, cut, may be an object's."""
    size = np.abs(shift)
    return float(np.sqrt(np.mean(np.minimum(size, np.quantile(size, 0.95)) ** 2)))


def _mean_row(rows: np.ndarray, weight: Floats) -> tuple[Floats, Floats]:
    area = weight.sum(axis=0)
    return (rows * weight).sum(axis=0) / area, area
