"""Detection of the beam at rest: the line from the clamp with the largest mean contrast.

A contrast that is too weak for a single pixel column adds up along the beam (a Radon transform over
lines that may be slightly bowed). The same means along lines elsewhere measure what the ground's
structure gives by chance.

Where the structure hides the beam, a filter that is matched to both is tried. A texture's gray
values are alike over many pixels, but a thin beam is narrow. Across a line, the optimal linear
filter weighs the pixels by the beam's expected profile and by the inverse covariance of the ground
(Turin 1960), here that of means along lines elsewhere. Beams of 0.7 px on textures have 3 to 10
times as many sigmas as by a difference of mean gray values. Shading and shadow of a wide beam
differ from the expected profile: it is found by the difference.

Bare steel may be brighter than its ground in one part and darker in another, and its mean contrast
is that of one of them. Its line is the one that differs from its sides in the most parts.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from solver.centreline.candidates import GAP, SIDE
from solver.centreline.guide import LINES, PLACES, Guide
from solver.centreline.line_sums import Line, Sheet, line_at, line_sums, straightened
from solver.centreline.noise import ROUNDING
from solver.centreline.second_line import GROUND_PX, SecondLine, across, find_second_line
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Mask
from solver.instrument.medians import SIGMA_OVER_MAD

# Lines elsewhere are within this many widths beside the beam, if that is more than BESIDE_PX.
BESIDE_WIDTHS = 6.0
# Largest distance [px] of the beam's middle from the line through its clamp and tip, and the step
# of tips and middles. Chosen: a bow of 2 % of the length.
MAX_BOW_PX, COARSE_PX = 8.0, 2.0
# The step for a filter that is matched to a beam of less than two pixels.
MATCHED_PX = 1.0
# Number of parts of the beam, in each of which its contrast may have either sign. Least contrast of
# a part that shows the beam: a share of the parts' median, and a number of robust sigmas of the
# contrast elsewhere. Least number of additional parts in which a better line shows it. Chosen.
N_PARTS, MIN_PART, BY_CHANCE, MORE_PARTS = 8, 0.25, 3.0, 0.5
# Steps of the refinement about the best line, of a tip and a middle [px]. Chosen: the profile fit
# starts within half a pixel of the beam.
FINE_PX = np.arange(-2.0, 2.25, 0.5)


class RestDetection(NamedTuple):
    """The beam at rest: `places` (n, 2) [m] of the beam's frame.

    `polarity` is 1 for a beam brighter than its ground, and -1 for a darker one: where it is of
    `either_sign`, that of its largest contrast. `width` is that of the detection, over the rig's
    diameter; `second` is a line beside it, if there is one.
    """

    places: Floats
    polarity: int
    width: int
    second: SecondLine | None
    either_sign: bool = False


def find_rest_line(image: Floats, guide: Guide, widths: Sequence[int]) -> RestDetection | None:
    """Find the beam in the mean image (height, width) of it at rest; return None without any.

    `widths` are trial widths over the rig's diameter. Of the lines whose contrast exceeds the
    scatter of those elsewhere by `min_line_sigmas`, the one of largest contrast is the beam.
    Without any, the matched filter is tried for the rig's diameter.
    """
    sheet = straightened(image, guide, BESIDE_WIDTHS * max(widths) * 2 * guide.radius_px)
    line, of_either_sign = _line_of_contrast(sheet, guide, widths), None
    if line is not None:
        of_either_sign = _line_of_either_sign(sheet, guide, line)
    line = of_either_sign or line or _matched_line(sheet, guide)
    if line is None:
        return None
    y = line_at(PLACES, line.tip, line.bow) + line.offset
    places = np.column_stack([guide.length * PLACES, guide.pixel * y])
    radius = line.width * guide.radius_px
    means = across(sheet, line, radius)
    second = None if means is None else find_second_line(means, line.polarity, radius)
    return RestDetection(places, line.polarity, line.width, second, of_either_sign is not None)


class _Trials(NamedTuple):
    """Trial tips and bows [px] of lines."""

    tips: Floats
    bows: Floats

    @classmethod
    def of(cls, line: Line) -> "_Trials":
        """Return one line alone."""
        return cls(np.array([line.tip]), np.array([line.bow]))


def _trials(guide: Guide, step: float) -> _Trials:
    """Return the trial lines, a `step` [px] apart."""
    largest_tip = THRESHOLDS.max_askew * guide.length / guide.pixel
    return _Trials(
        np.arange(-largest_tip, largest_tip + step, step),
        np.arange(-MAX_BOW_PX, MAX_BOW_PX + step, step),
    )


class _Peak(NamedTuple):
    """The largest response of lines, and the line's tip, bow and offset [px]."""

    response: float
    tip: float
    bow: float
    offset: float


def _refined(
    offset: Floats,
    trials: _Trials,
    coarse: Floats,
    near: Mask,
    respond: Callable[[_Trials], Floats],
) -> _Peak:
    """Find the largest of finer responses about that of the `coarse` ones (tip, bow, offset).

    Offsets (n,) [px] are `near` the nominal beam; `respond` computes the responses of trial lines.
    """
    at = np.nanargmax(coarse[..., near])
    tip, bow, _ = np.unravel_index(at, coarse[..., near].shape)
    finer = _Trials(trials.tips[tip] + FINE_PX, trials.bows[bow] + FINE_PX)
    fine = respond(finer)[..., near]
    tip, bow, k = np.unravel_index(np.nanargmax(fine), fine.shape)
    return _Peak(float(fine[tip, bow, k]), finer.tips[tip], finer.bows[bow], offset[near][k])


def _near(sheet: Sheet, core: int) -> Mask:
    """Mark the offsets (n,) near the nominal beam, which is `core` [px] wide."""
    largest = max(THRESHOLDS.near_px, THRESHOLDS.near_radii_at_rest * core / 2)
    return np.asarray(np.abs(sheet.offset) <= largest)


def _elsewhere(sheet: Sheet, core: int) -> Mask:
    """Mark the offsets (n,) of lines that show nothing of the beam."""
    return np.asarray(np.abs(sheet.offset) > core + 2 * (GAP + SIDE) + THRESHOLDS.near_px)


def _line_of_contrast(sheet: Sheet, guide: Guide, widths: Sequence[int]) -> Line | None:
    """Find the line that differs most in mean gray value from both sides."""
    trials = _trials(guide, COARSE_PX)
    coarse = line_sums(sheet, *trials)
    best: Line | None = None
    largest = -np.inf
    for width in widths:
        core = max(2, round(width * 2 * guide.radius_px))
        near, beside = _near(sheet, core), _elsewhere(sheet, core)
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
            respond = partial(_contrasts_along, sheet, core, polarity)
            peak = _refined(sheet.offset, trials, contrasts, near, respond)
            if peak.response > max(largest, middle + THRESHOLDS.min_line_sigmas * by_chance):
                line = Line(peak.tip, peak.bow, peak.offset, polarity, width)
                if not _is_gap(sheet, line, peak.response, width * guide.radius_px):
                    best, largest = line, peak.response
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


def _line_of_either_sign(sheet: Sheet, guide: Guide, line: Line) -> Line | None:
    """Find the line of a beam that is brighter than its ground in some parts, and darker in others.

    Return None where `line`, that of one sign, shows the beam in all parts, or where no other one
    shows it in more of them, and in more than lines elsewhere show by chance.
    """
    core = max(2, round(line.width * 2 * guide.radius_px))
    parts, beside = sheet.parts(N_PARTS), _elsewhere(sheet, core)
    here = _nearest(sheet, line.offset)
    both = _contrasts_of_parts(parts, core, _Trials.of(line))
    along = both[0 if line.polarity > 0 else 1, :, 0, 0, here]
    elsewhere = np.fmax(*both)[..., beside]
    if not (np.isfinite(along).any() and np.isfinite(elsewhere).any()):
        return None
    least = MIN_PART * np.nanmedian(along)
    if np.nanmin(along) > least:
        return None
    scatter = SIGMA_OVER_MAD * np.nanmedian(np.abs(elsewhere))
    by_chance = math.hypot(scatter, math.sqrt(ROUNDING * N_PARTS / (LINES * core)))
    shown = partial(_share_of_parts, parts, core, max(least, BY_CHANCE * by_chance))
    trials, near = _trials(guide, COARSE_PX), _near(sheet, core)
    coarse, of_line = shown(trials), shown(_Trials.of(line))[0, 0, here]
    if not (np.isfinite(of_line) and np.isfinite(coarse[..., near]).any()):
        return None
    peak = _refined(sheet.offset, trials, coarse, near, shown)
    at_least = of_line + MORE_PARTS / N_PARTS
    if peak.response < max(at_least, np.nanmax(coarse[..., beside], initial=0.0)):
        return None
    found = line._replace(tip=peak.tip, bow=peak.bow, offset=peak.offset)
    both = _contrasts_of_parts(parts, core, _Trials.of(found))
    bright, dark = np.nanmax(both[:, :, 0, 0, _nearest(sheet, found.offset)], axis=1)
    return found._replace(polarity=1 if bright >= dark else -1)


def _nearest(sheet: Sheet, offset: float) -> int:
    """Return the index of the offset that is nearest to one [px]."""
    return int(np.argmin(np.abs(sheet.offset - offset)))


def _contrasts_along(sheet: Sheet, core: int, polarity: int, trials: _Trials) -> Floats:
    """Compute the contrasts (tip, bow, offset) of trial lines."""
    return _contrasts(line_sums(sheet, *trials), core, polarity)


def _contrasts_of_parts(parts: Sequence[Sheet], core: int, trials: _Trials) -> Floats:
    """Compute the contrasts (2, part, tip, bow, offset) of the parts of trial lines.

    They are those of a beam that is brighter than its ground, and of a darker one.
    """
    sums = [line_sums(part, *trials) for part in parts]
    return np.stack([[_contrasts(one, core, sign) for one in sums] for sign in (1, -1)])


def _share_of_parts(parts: Sequence[Sheet], core: int, least: float, trials: _Trials) -> Floats:
    """Compute the share (tip, bow, offset) of their parts in which trial lines show a beam.

    A part counts by its contrast, of any sign, over the sum of this and the `least` one. NaN where
    fewer than the share `min_support_at_rest` of the parts are in the image.
    """
    contrast = np.maximum(np.fmax(*_contrasts_of_parts(parts, core, trials)), 0)
    count = np.isfinite(contrast).sum(axis=0)
    enough = count >= THRESHOLDS.min_support_at_rest * len(parts)
    shown = np.nansum(contrast / (contrast + least), axis=0)
    return np.where(enough, shown / np.maximum(count, 1), np.nan)


def _matched_line(sheet: Sheet, guide: Guide) -> Line | None:
    """Find the line whose response exceeds that of all lines elsewhere; None if there is none.

    It must also exceed the scatter elsewhere by `min_line_sigmas`. The filter is matched to a beam
    of the rig's radius.
    """
    radius, trials = guide.radius_px, _trials(guide, MATCHED_PX)
    # Lines elsewhere are as long as the beam: shorter ones scatter more.
    whole = float(np.isfinite(sheet.gray).any(axis=0).mean())
    beside = np.abs(sheet.offset) > 2 * (radius + GAP + SIDE) + THRESHOLDS.near_px
    elsewhere = line_sums(sheet, *trials, whole)
    elsewhere[..., ~beside] = np.nan
    matched = _filter(elsewhere, radius)
    if matched is None:
        return None
    near = np.abs(sheet.offset) <= max(THRESHOLDS.near_px, THRESHOLDS.near_radii_at_rest * radius)
    coarse = line_sums(sheet, *trials)
    best, most = None, THRESHOLDS.min_line_sigmas
    for polarity in (1, -1):
        by_chance = float(np.max(matched.sigmas(elsewhere, polarity)))
        respond = partial(_sigmas_along, sheet, matched, polarity)
        found = matched.sigmas(coarse, polarity)
        peak = _refined(sheet.offset, trials, found, near, respond)
        if peak.response > max(most, by_chance):
            most = peak.response
            best = Line(peak.tip, peak.bow, peak.offset, polarity, width=1)
    return best


def _sigmas_along(sheet: Sheet, matched: "_Filter", polarity: int, trials: _Trials) -> Floats:
    """Filter trial lines (tip, bow, offset)."""
    return matched.sigmas(line_sums(sheet, *trials), polarity)


class _Filter(NamedTuple):
    """Weights (n,) of the pixels across a line, in units of the response's scatter elsewhere.

    `above` and `below` (n,) are the differences of the line from the pixel on either side.
    """

    weights: Floats
    above: Floats
    below: Floats

    def sigmas(self, sums: Floats, polarity: int) -> Floats:
        """Filter lines (tip, bow, offset); -inf where a line is not brighter than both sides.

        Not darker, where `polarity` is -1: an edge has a response, too.
        """
        windows = np.lib.stride_tricks.sliding_window_view(sums, len(self.weights), axis=-1)
        ridge = np.minimum(polarity * (windows @ self.above), polarity * (windows @ self.below))
        result = np.full(sums.shape, -np.inf)
        half = len(self.weights) // 2
        result[..., half:-half] = np.where(ridge > 0, polarity * (windows @ self.weights), -np.inf)
        return result


def _filter(sums: Floats, radius: float) -> _Filter | None:
    """Match a filter to a beam of `radius` [px] and to means along lines (tip, bow, offset).

    Return None if all lines are NaN. Levels and slopes across have no weight.
    """
    half = int(np.ceil(radius)) + GAP
    offset = np.arange(-half, half + 1)
    # A pixel and the step of the search blur the beam.
    beam = np.clip(radius + 1.0 - np.abs(offset), 0.0, 1.0)
    windows = np.lib.stride_tricks.sliding_window_view(sums, len(offset), axis=-1)
    elsewhere = windows.reshape(-1, len(offset))
    elsewhere = elsewhere[np.isfinite(elsewhere).all(axis=1)]
    if len(elsewhere) < len(offset):
        return None
    polynomials = np.column_stack([np.ones(len(offset)), offset])
    basis = np.linalg.svd(polynomials)[0][:, 2:]
    rounding = ROUNDING / LINES
    covariance = np.cov(elsewhere @ basis, rowvar=False) + rounding * np.eye(len(offset) - 2)
    weights = basis @ np.linalg.solve(covariance, basis.T @ beam)
    scatter = SIGMA_OVER_MAD * float(np.median(np.abs(elsewhere @ weights)))
    core = beam / beam.sum()
    beyond = int(np.ceil(radius)) + GAP
    return _Filter(
        weights / np.hypot(scatter, np.sqrt(rounding * weights @ weights)),
        core - (offset == -beyond),
        core - (offset == beyond),
    )
