"""Detection of the beam at rest: the line from the clamp with the largest mean contrast.

A contrast that is too weak for a single pixel column adds up along the beam (a Radon transform over
lines that may be slightly bowed). The same means along lines elsewhere measure what the ground's
structure gives by chance.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from solver.centreline.candidates import GAP, SIDE
from solver.centreline.guide import LINES, Guide
from solver.centreline.noise import ROUNDING
from solver.centreline.thresholds import LIMITS
from solver.instrument.arrays import Floats

# Part of the beam's length that is summed: its clamp and its end are left out.
FIRST, LAST = 0.05, 0.97
# Lines elsewhere are within this distance [px] beside the beam, or this many widths if that is
# more. Chosen: a hundred lines, under light that is still like that at the beam.
BESIDE_PX, BESIDE_WIDTHS = 60.0, 6.0
# Largest distance [px] of the beam's middle from the line through its clamp and tip, and the step
# of tips and middles. Chosen: a bow of 2 % of the length.
MAX_BOW_PX, COARSE_PX = 8.0, 2.0
# Steps of the refinement about the best line, of a tip and a middle [px]. Chosen: the profile fit
# starts within half a pixel of the beam.
FINE_PX = np.arange(-2.0, 2.25, 0.5)


class RestLine(NamedTuple):
    """The beam at rest: `places` (n, 2) [m] of the beam's frame, and its mean contrast [gray].

    `polarity` is 1 for a beam brighter than its ground, and -1 for a darker one; `width` is that of
    the detection, over the rig's diameter.
    """

    places: Floats
    contrast: float
    polarity: int
    width: int


def find_rest_line(image: Floats, guide: Guide, widths: Sequence[int]) -> RestLine | None:
    """Find the beam in the mean image (height, width) of it at rest; return None without any.

    `widths` are trial widths over the rig's diameter. Of the lines whose contrast exceeds the
    scatter of those elsewhere by `min_line_sigmas`, the one of largest contrast is the beam.
    """
    sheet = _straightened(image, guide, BESIDE_WIDTHS * max(widths) * 2 * guide.radius_px)
    largest_tip = LIMITS.max_askew * guide.length / guide.pixel
    tips = np.arange(-largest_tip, largest_tip + COARSE_PX, COARSE_PX)
    bows = np.arange(-MAX_BOW_PX, MAX_BOW_PX + COARSE_PX, COARSE_PX)
    coarse = _sums(sheet, tips, bows)
    best: RestLine | None = None
    for width in widths:
        core = max(2, round(width * 2 * guide.radius_px))
        near = np.abs(sheet.offset) <= max(LIMITS.near_px, LIMITS.near_radii_at_rest * core / 2)
        beside = np.abs(sheet.offset) > core + 2 * (GAP + SIDE) + LIMITS.near_px
        for polarity in (1, -1):
            contrasts = _contrasts(coarse, core, polarity)
            elsewhere = contrasts[..., beside]
            elsewhere = elsewhere[np.isfinite(elsewhere)]
            if not len(elsewhere) or not np.isfinite(contrasts[..., near]).any():
                continue
            middle = float(np.median(elsewhere))
            n_pixels = LINES * core
            by_chance = np.hypot(
                1.4826 * np.median(np.abs(elsewhere - middle)), np.sqrt(ROUNDING / n_pixels)
            )
            at = np.nanargmax(contrasts[..., near])
            tip, bow, _ = np.unravel_index(at, contrasts[..., near].shape)
            finer = (tips[tip] + FINE_PX, bows[bow] + FINE_PX)
            fine = _contrasts(_sums(sheet, *finer), core, polarity)[..., near]
            tip, bow, offset = np.unravel_index(np.nanargmax(fine), fine.shape)
            contrast = float(fine[tip, bow, offset])
            if contrast - middle < LIMITS.min_line_sigmas * by_chance:
                continue
            if best is None or contrast > best.contrast:
                x = np.linspace(0.0, 1.06, 96)
                y = _line(x, finer[0][tip], finer[1][bow]) + sheet.offset[near][offset]
                places = np.column_stack([guide.length * x, guide.pixel * y])
                best = RestLine(places, contrast, polarity, width)
    return best


class _Sheet(NamedTuple):
    """The image along the beam: gray values (n, LINES), n offsets [px] across, and positions.

    `x` (LINES,) is over the beam's length. Values beside the image are NaN.
    """

    gray: Floats
    offset: Floats
    x: Floats


def _straightened(image: Floats, guide: Guide, beside: float) -> _Sheet:
    """Sample the image each pixel across the nominal beam, and average along it over each line."""
    half = round(max(BESIDE_PX, beside))
    offset = np.arange(-half, half + 1, dtype=np.float64)
    per_line = max(round((LAST - FIRST) * guide.length / guide.pixel / LINES), 1)
    x = np.linspace(FIRST, LAST, LINES * per_line)
    along, across = np.meshgrid(guide.length * x, guide.pixel * offset)
    pixels = guide.pixels(np.column_stack([along.ravel(), across.ravel()])).astype(np.float32)
    u, v = pixels[:, 0].reshape(along.shape), pixels[:, 1].reshape(along.shape)
    gray = cv2.remap(
        image.astype(np.float32), u, v, cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=(np.nan,),
    )  # fmt: skip
    return _Sheet(
        gray.reshape(len(offset), LINES, per_line).mean(axis=2, dtype=np.float64),
        offset,
        x.reshape(LINES, per_line).mean(axis=1),
    )


def _line(x: Floats, tip: float, bow: float) -> Floats:
    """Compute the distance [px] of a bowed line from the nominal beam, at x over the length."""
    return np.asarray(tip * x + bow * 4 * x * (1 - x))


def _sums(sheet: _Sheet, tips: Floats, bows: Floats) -> Floats:
    """Average the sheet along each line (tip, bow, offset); NaN with too few lines in the image."""
    n = len(sheet.offset)
    known = np.isfinite(sheet.gray)
    # Rows beyond the sheet are unknown.
    gray = np.vstack([np.where(known, sheet.gray, 0.0), np.zeros((1, LINES))])
    known = np.vstack([known, np.zeros((1, LINES), bool)])
    result = np.empty((len(tips), len(bows), n))
    for i, tip in enumerate(tips):
        for j, bow in enumerate(bows):
            shift = np.rint(_line(sheet.x, tip, bow)).astype(np.int64)
            row = np.arange(n)[:, None] + shift
            row = np.where((row >= 0) & (row < n), row, n)
            count = np.take_along_axis(known, row, 0).sum(axis=1)
            total = np.take_along_axis(gray, row, 0).sum(axis=1)
            enough = count > LIMITS.min_support_at_rest * LINES
            result[i, j] = np.where(enough, total / np.maximum(count, 1), np.nan)
    return result


def _contrasts(sums: Floats, core: int, polarity: int) -> Floats:
    """Compute the contrast of `core` offsets with the nearer in gray value of their two sides.

    `sums` and the contrasts are (tip, bow, offset); contrasts are NaN at the border.
    """
    core_mean, side_mean = _means(sums, core), _means(sums, SIDE)
    result = np.full(sums.shape, np.nan)
    first = SIDE + GAP
    inner = core_mean[..., first : core_mean.shape[-1] - first]
    n = inner.shape[-1]
    above, below = side_mean[..., :n], side_mean[..., core + 2 * GAP + SIDE :]
    low = first + core // 2
    result[..., low : low + n] = np.minimum(polarity * (inner - above), polarity * (inner - below))
    return result


def _means(sums: Floats, size: int) -> Floats:
    """Average `size` neighbours of the last axis; NaN only where one of them is."""
    return np.asarray(np.lib.stride_tricks.sliding_window_view(sums, size, axis=-1).mean(axis=-1))
