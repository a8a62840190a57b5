"""Detection of a beam at rest that the ground's structure hides: a filter matched to both.

A texture's gray values are alike over many pixels, but a thin beam is narrow. Across a line, the
optimal linear filter weighs the pixels by the beam's expected profile and by the inverse covariance
of the ground (Turin 1960), here that of means along lines elsewhere. Beams of 0.7 px on textures
have 3 to 10 times as many sigmas as by a difference of mean gray values. Shading and shadow of a
wide beam differ from the expected profile: it is found by the difference.
"""

from typing import NamedTuple

import numpy as np

from solver.centreline.candidates import GAP, SIDE
from solver.centreline.guide import LINES
from solver.centreline.line_sums import Line, Sheet, line_sums
from solver.centreline.noise import ROUNDING
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.medians import SIGMA_OVER_MAD


def find_matched_line(
    sheet: Sheet, tips: Floats, bows: Floats, finer: Floats, radius: float
) -> Line | None:
    """Find the line whose response exceeds that of all lines elsewhere; None if there is none.

    It must also exceed the scatter elsewhere by `min_line_sigmas`. Lines of all `tips` and `bows`
    [px] are tried, and `finer` steps about the best. `radius` [px] is that of the beam.
    """
    # Lines elsewhere are as long as the beam: shorter ones scatter more.
    whole = float(np.isfinite(sheet.gray).any(axis=0).mean())
    beside = np.abs(sheet.offset) > 2 * (radius + GAP + SIDE) + THRESHOLDS.near_px
    elsewhere = line_sums(sheet, tips, bows, whole)
    elsewhere[..., ~beside] = np.nan
    matched = _filter(elsewhere, radius)
    if matched is None:
        return None
    near = np.abs(sheet.offset) <= max(THRESHOLDS.near_px, THRESHOLDS.near_radii_at_rest * radius)
    coarse = line_sums(sheet, tips, bows)
    best, most = None, THRESHOLDS.min_line_sigmas
    for polarity in (1, -1):
        by_chance = float(np.max(matched.sigmas(elsewhere, polarity)))
        tip, bow, _ = _largest(matched.sigmas(coarse, polarity)[..., near])
        about = tips[tip] + finer, bows[bow] + finer
        sigmas = matched.sigmas(line_sums(sheet, *about), polarity)[..., near]
        tip, bow, offset = _largest(sigmas)
        if sigmas[tip, bow, offset] > max(most, by_chance):
            most = float(sigmas[tip, bow, offset])
            start = sheet.offset[near][offset]
            best = Line(about[0][tip], about[1][bow], start, polarity, width=1)
    return best


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


def _largest(sigmas: Floats) -> tuple[np.intp, ...]:
    return np.unravel_index(np.argmax(sigmas), sigmas.shape)
