"""The area-weighted average of the paper's Fig. 15: the beam's centre in every image column.

In a column, the pixels brighter than a threshold belong to the beam, and their mean row,
weighted by how much of each the beam covers, is its centre. Cover is read off the gray
value: (gray - background) / (beam - background). Cutting the faint flanks off makes the
centre follow the pixel grid a little (an S-curve of period one pixel); that error is part
of the method, and its size is added to each point's sigma.
"""

import numpy as np
from scipy import ndimage

from solver.centreline import Centreline
from solver.instrument.arrays import Floats, Grey

# Of the contrast between beam and background: low enough to keep the flanks of a line two
# pixels wide, high enough to leave a dark object beside it out.
THRESHOLD = 0.25
# A column shows the beam if its brightest pixel stands out by this share of the whole image's
# contrast and by this many sigmas of its background.
LEAST_CONTRAST = 0.5
LEAST_SIGNIFICANCE = 8.0
# Root mean square of the S-curve for a line 1.6 px wide, cut at THRESHOLD [px].
S_CURVE_RMS_PX = 0.05
WIDEST_PX = 12


def area_weighted(image: Grey) -> Centreline:
    """The centreline of the bright beam that runs from left to right in `image` (height, width).

    Columns in which no beam stands out are absent. Empty if there is none at all.
    """
    gray = image.astype(np.float64)
    columns = np.arange(gray.shape[1])
    # Every fourth row tells a column's background as well as all of them, and sooner.
    some = gray[::4]
    background = np.median(some, axis=0)
    noise = 1.4826 * np.median(np.abs(some - background), axis=0) + 0.3  # 0.3: 8-bit rounding
    contrast = gray.max(axis=0) - background
    overall = np.quantile(contrast, 0.9)
    seen = (contrast > LEAST_CONTRAST * overall) & (contrast > LEAST_SIGNIFICANCE * noise)
    if not seen.any():
        return Centreline(np.empty((0, 2)), np.empty(0))

    above = (gray - background > THRESHOLD * contrast) & seen
    beam = _largest_band(above)
    cover = np.where(beam, gray - background, 0.0)
    area = cover.sum(axis=0)
    width = beam.sum(axis=0)
    good = seen & (width > 0) & (width <= WIDEST_PX)
    rows = np.arange(gray.shape[0], dtype=np.float64)[:, None]
    safe = np.where(good, area, 1.0)
    centre = (rows * cover).sum(axis=0) / safe
    # d centre / d gray = (row - centre) / area; shot noise grows with the gray value.
    lever = np.where(beam, rows - centre, 0.0)
    variance = ((lever * _noise_of(gray, background, noise)) ** 2).sum(axis=0) / safe**2
    sigma = np.sqrt(variance + S_CURVE_RMS_PX**2)
    return Centreline(np.column_stack([columns, centre])[good], sigma[good])


def _largest_band(above: np.ndarray) -> np.ndarray:
    """The connected region that spans the most columns: the beam, not a glint beside it."""
    labels, count = ndimage.label(above, structure=np.ones((3, 3)))
    if count <= 1:
        return np.asarray(labels > 0)
    spans = [where[1].stop - where[1].start for where in ndimage.find_objects(labels)]
    band: np.ndarray = labels == 1 + int(np.argmax(spans))
    return band


def _noise_of(gray: Floats, background: Floats, noise: Floats) -> Floats:
    """Gray-value sigma per pixel: variance proportional to gray, as shot noise is."""
    return np.asarray(noise * np.sqrt(np.maximum(gray, 1.0) / np.maximum(background, 1.0)))
