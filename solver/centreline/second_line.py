"""Detection of a second line beside the beam at rest: its shadow, a reflection, another wire.

The mean gray values along lines parallel to the beam have another peak there. A profile fit whose
pixels show both lines would take them for one beam, with its axis between them.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from solver.centreline.guide import Guide
from solver.centreline.line_sums import Line, Sheet, line_at
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.medians import SIGMA_OVER_MAD

# Lines farther away than these pixels, or these radii, are not looked for. Chosen: beyond the
# pixels of a profile fit.
REACH_PX, REACH_RADII = 16.0, 8.0
# The ground is the median within these pixels and radii on both sides. Chosen: a window of which
# the beam and a shadow that is wider than it cover less than half.
GROUND_PX, GROUND_RADII = 8, 6
# A line begins where it has this share of its height. Chosen: less moves the beam by little.
FOOT = 0.2


class SecondLine(NamedTuple):
    """A line parallel to the beam.

    Its `offset` [px] is along the beam's y axis, and its `contrast` over the beam's, negative where
    one of them is brighter than the ground and the other darker. Its edge is `clear_px` from the
    beam's axis.
    """

    offset: float
    contrast: float
    clear_px: float


class Across(NamedTuple):
    """Means along lines parallel to the beam: their `offset` (n,) [px] from it, and gray values.

    `relief` (n,) is their difference from the `ground` about them.
    """

    offset: Floats
    relief: Floats


def across(sheet: Sheet, line: Line, radius: float) -> Across | None:
    """Average the sheet along lines parallel to `line`; None where it is not in the image.

    `radius` [px] is that of a beam along it.
    """
    course = line_at(sheet.x, line.tip, line.bow) + line.offset
    aligned = np.column_stack(
        [
            np.interp(sheet.offset + shift, sheet.offset, gray, left=np.nan, right=np.nan)
            for shift, gray in zip(course, sheet.gray.T, strict=True)
        ]
    )
    known = np.isfinite(aligned).mean(axis=1) >= THRESHOLDS.min_support_at_rest
    middle = len(known) // 2
    if not known[middle]:
        return None
    unknown = np.flatnonzero(~known)
    first = int(unknown[unknown < middle].max(initial=-1)) + 1
    last = int(unknown[unknown > middle].min(initial=len(known)))
    mean = np.nanmedian(aligned[first:last], axis=1)
    size = 2 * (GROUND_PX + math.ceil(GROUND_RADII * radius)) + 1
    return Across(sheet.offset[first:last], mean - median_filter(mean, size, mode="nearest"))


def find_second_line(means: Across, polarity: int, radius: float) -> SecondLine | None:
    """Find the line that is nearest to a beam of this `polarity`; None without any.

    `radius` [px] is the beam's. Flanks of the opposite sign, as of polished steel or of a sharpened
    image, are a part of the beam: they adjoin it, or are on both of its sides.
    """
    offset, beam = means.offset, polarity * means.relief
    own = np.flatnonzero(np.abs(offset) <= radius + 1)
    top = int(own[np.argmax(beam[own])])
    height = float(beam[top])
    beside = np.abs(offset) > radius + GROUND_PX
    if height <= 0 or not beside.any():
        return None
    left, right = (_edge(beam, top, side, THRESHOLDS.beam_edge) for side in (-1, 1))
    axis, edge = top + (right - left) / 2, (right + left) / 2
    if not math.isfinite(axis):
        return None
    by_chance = SIGMA_OVER_MAD * float(np.median(np.abs(beam[beside])))
    least = max(THRESHOLDS.min_second_contrast * height, THRESHOLDS.min_line_sigmas * by_chance)
    reach = max(REACH_PX, REACH_RADII * radius)
    lines = []
    for sign in (1, -1):
        # The ground between two lines is no line of the other sign.
        relief = np.maximum(sign * beam, 0.0)
        for peak, prominence in find_peaks(relief, least):
            side = 1 if peak > axis else -1
            distance = side * (_vertex(relief, peak) - axis)
            if not edge + THRESHOLDS.min_gap_px <= distance <= reach:
                continue
            opposite = round(2 * axis) - peak
            mirrored = relief[max(opposite - 1, 0) : max(opposite + 2, 0)]
            if sign < 0 and mirrored.max(initial=0.0) > THRESHOLDS.flank_symmetry * prominence:
                continue
            # The outer flank: the inner one may overlap with the beam's.
            clear = distance - _edge(relief, peak, side, FOOT)
            lines.append(SecondLine(side * distance, sign * prominence / height, clear))
    return min(lines, key=lambda other: abs(other.offset), default=None)


def describe(second: SecondLine, guide: Guide) -> str:
    """Describe a line beside the beam by its distance, side and contrast, with what to do."""
    across = guide.pixel * second.offset
    here, there = guide.pixels(np.array([[0.5 * guide.length, 0.0], [0.5 * guide.length, across]]))
    right, down = there - here
    if abs(down) >= abs(right):
        side = "below" if down > 0 else "above"
    else:
        side = "right of" if right > 0 else "left of"
    return (
        f"the rest images show a second line parallel to the beam, {abs(second.offset):.0f} px "
        f"{side} it, with {abs(second.contrast):.2g} times its contrast: a shadow, a reflection or "
        "another wire; remove it, or move the lamp or the ground"
    )


class Peak(NamedTuple):
    """The index `place` of a local maximum, the middle one of equal values, and its prominence.

    The prominence is its height above the higher of the two lowest values that separate it from
    higher values, or from the ends, on its left and on its right.
    """

    place: int
    prominence: float


def find_peaks(values: Floats, prominence: float) -> Iterator[Peak]:
    """Yield the peaks of at least this prominence in `values` (n,), without those at its ends.

    `scipy.signal` finds them, too, but to import it takes a third of a start's time.
    """
    first = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    last = np.append(first[1:], len(values)) - 1
    heights = values[first]
    top = 1 + np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:]))
    for start, stop, height in zip(first[top], last[top], heights[top], strict=True):
        sides = values[start::-1], values[stop:]
        found = height - max(_least_before_higher(side) for side in sides)
        if found >= prominence:
            yield Peak(int(start + stop) // 2, float(found))


def _least_before_higher(values: Floats) -> float:
    """Return the least value before the first one that is higher than `values[0]`, or of all."""
    higher = values > values[0]
    return float(values[: np.argmax(higher) if higher.any() else None].min())


def _vertex(values: Floats, peak: int) -> float:
    """Refine the index of a peak by a parabola."""
    if not 0 < peak < len(values) - 1:
        return float(peak)
    before, here, after = values[peak - 1 : peak + 2]
    curvature = before - 2 * here + after
    return peak + float(0.5 * (before - after) / curvature if curvature < 0 else 0.0)


def _edge(relief: Floats, top: int, side: int, share: float) -> float:
    """Return the pixels from a line's top to where it has a `share` of its height, on a `side`."""
    flank = relief[top::side] / relief[top] - share
    fallen = np.flatnonzero(flank < 0)
    if not len(fallen):
        return np.inf
    first = int(fallen[0])
    return first - float(flank[first] / (flank[first] - flank[first - 1]))
