"""Detection of the beam at rest: the line from the clamp with the largest mean contrast.

A contrast that is too weak for a single pixel column adds up along the beam (a Radon transform over
lines that may be slightly bowed). The same means along lines elsewhere measure what the ground's
structure gives by chance. Where it hides the beam, a filter that is matched to both is tried.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from solver.centreline.candidates import GAP, SIDE
from solver.centreline.guide import LINES, Guide
from solver.centreline.line_sums import Line, Sheet, line_at, line_sums, straightened
from solver.centreline.matched_line import find_matched_line
from solver.centreline.noise import ROUNDING
from solver.centreline.second_line import GROUND_PX, SecondLine, across, find_second_line
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.medians import SIGMA_OVER_MAD

# Lines elsewhere are within this many widths beside the beam, if that is more than BESIDE_PX.
BESIDE_WIDTHS = 6.0
# Largest distance [px] of the beam's middle from the line through its clamp and tip, and the step
# of tips and middles. Chosen: a bow of 2 % of the length.
MAX_BOW_PX, COARSE_PX = 8.0, 2.0
# The step for a filter that is matched to a beam of less than two pixels.
MATCHED_PX = 1.0
# Steps of the refinement about the best line, of a tip and a middle [px]. Chosen: the profile fit
# starts within half a pixel of the beam.
FINE_PX = np.arange(-2.0, 2.25, 0.5)


class RestDetection(NamedTuple):
    """The beam at rest: `places` (n, 2) [m] of the beam's frame.

    `polarity` is 1 for a beam brighter than its ground, and -1 for a darker one; `width` is that of
    the detection, over the rig's diameter; `second` is a line beside it, if there is one.
    """

    places: Floats
    polarity: int
    width: int
    second: SecondLine | None


def find_rest_line(image: Floats, guide: Guide, widths: Sequence[int]) -> RestDetection | None:
    """Find the beam in the mean image (height, width) of it at rest; return None without any.

    `widths` are trial widths over the rig's diameter. Of the lines whose contrast exceeds the
    scatter of those elsewhere by `min_line_sigmas`, the one of largest contrast is the beam.
    Without any, the matched filter is tried for the rig's diameter.
    """
    sheet = straightened(image, guide, BESIDE_WIDTHS * max(widths) * 2 * guide.radius_px)
    line = _line_of_contrast(sheet, guide, widths) or find_matched_line(
        sheet, *_trials(guide, MATCHED_PX), FINE_PX, guide.radius_px
    )
    if line is None:
        return None
    x = np.linspace(0.0, 1.06, 96)
    y = line_at(x, line.tip, line.bow) + line.offset
    places = np.column_stack([guide.length * x, guide.pixel * y])
    radius = line.width * guide.radius_px
    means = across(sheet, line, radius)
    second = None if means is None else find_second_line(means, line.polarity, radius)
    return RestDetection(places, line.polarity, line.width, second)


def _trials(guide: Guide, step: float) -> tuple[Floats, Floats]:
    """Return the trial tips and bows [px] of lines, a `step` apart."""
    largest_tip = THRESHOLDS.max_askew * guide.length / guide.pixel
    return (
        np.arange(-largest_tip, largest_tip + step, step),
        np.arange(-MAX_BOW_PX, MAX_BOW_PX + step, step),
    )


def _line_of_contrast(sheet: Sheet, guide: Guide, widths: Sequence[int]) -> Line | None:
    """Find the line that differs most in mean gray value from both sides."""
    tips, bows = _trials(guide, COARSE_PX)
    coarse = line_sums(sheet, tips, bows)
    best: Line | None = None
    largest = -np.inf
    for width in widths:
        core = max(2, round(width * 2 * guide.radius_px))
        near = np.abs(sheet.offset) <= max(
            THRESHOLDS.near_px, THRESHOLDS.near_radii_at_rest * core / 2
        )
        beside = np.abs(sheet.offset) > core + 2 * (GAP + SIDE) + THRESHOLDS.near_px
        for polarity in (1, -1):
            contrasts = _contrasts(coarse, core, polarity)
            elsewhere = contrasts[..., beside]
            elsewhere = elsewhere[np.isfinite(elsewhere)]
            if not len(elsewhere) or not np.isfinite(contrasts[..., near]).any():
                continue
            middle = float(np.median(elsewhere))
            n_pixels = LINES * core
            by_chance = np.hypot(
                SIGMA_OVER_MAD * np.median(np.abs(elsewhere - middle)), np.sqrt(ROUNDING / n_pixels)
            )
            at = np.nanargmax(contrasts[..., near])
            tip, bow, _ = np.unravel_index(at, contrasts[..., near].shape)
            finer = (tips[tip] + FINE_PX, bows[bow] + FINE_PX)
            fine = _contrasts(line_sums(sheet, *finer), core, polarity)[..., near]
            tip, bow, offset = np.unravel_index(np.nanargmax(fine), fine.shape)
            contrast = float(fine[tip, bow, offset])
            if contrast > max(largest, middle + THRESHOLDS.min_line_sigmas * by_chance):
                start = sheet.offset[near][offset]
                line = Line(finer[0][tip], finer[1][bow], start, polarity, width)
                if not _is_gap(sheet, line, contrast, width * guide.radius_px):
                    best, largest = line, contrast
    return best


def _is_gap(sheet: Sheet, line: Line, contrast: float, radius: float) -> bool:
    """Return whether a line is the ground between two others, of the other polarity."""
    means = across(sheet, line, radius)
    if means is None:
        return False
    relief, least = line.polarity * means.relief, THRESHOLDS.min_relief * contrast
    own = np.abs(means.offset) <= radius + 1
    sides = [
        relief[(means.offset * side > 0) & (np.abs(means.offset) <= 2 * radius + GROUND_PX)]
        for side in (-1, 1)
    ]
    lines_beside = all(side.min(initial=0.0) < -least for side in sides)
    return lines_beside and bool(relief[own].max() < least)


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
