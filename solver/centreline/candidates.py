"""Detection of candidates for the beam: thin objects that contrast with both sides."""

import numpy as np
import numpy.typing as npt

from solver.centreline.noise import Noise, pixel_variance
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit

# Maximum number of candidates per line; the strongest are kept.
MAX_PER_LINE = 6
# Pixels on either side that measure the surroundings, and between them and the core.
SIDE, GAP = 2, 1


@njit
def candidates(
    image: Grey,
    lines: npt.NDArray[np.uint64],
    upright: bool,
    core: int,
    polarity: int,
    noise: Noise,
) -> Floats:
    """Detect candidates; return rows (m, 3): line, place [px] and contrast [gray].

    `lines` are pixel columns, or rows where not `upright`. The mean of `core` pixels must exceed
    the higher of the means on its two sides (fall short of the lower, where `polarity` is -1), so
    that edges, which are higher than one side only, are no candidates. Places are refined by a
    parabola.
    """
    response, level, largest = _responses(_summed(image, lines, upright, polarity), core)
    margin = core // 2 + GAP + SIDE
    # Threshold at the least possible noise, in units of `response`.
    scale = 1.0 / (core * SIDE)
    threshold = (
        THRESHOLDS.candidate_sigmas
        * np.sqrt(pixel_variance(noise, 0.0) * (1.0 / core + 1.0 / SIDE))
        / scale
    )
    out, count = np.empty((len(lines), MAX_PER_LINE, 3)), np.zeros(len(lines), np.int64)
    for v in range(margin + 1, len(response) - margin - 1):
        if largest[v] < threshold:
            continue
        before, here, after = response[v - 1], response[v], response[v + 1]
        for j in range(len(lines)):
            if here[j] < threshold or here[j] < before[j] or here[j] <= after[j]:
                continue
            r = here[j] * scale
            gray = abs(level[v, j]) / SIDE + r / 2
            variance = pixel_variance(noise, gray) * (1.0 / core + 1.0 / SIDE)
            if r * r < THRESHOLDS.candidate_sigmas**2 * variance:
                continue
            curvature = before[j] - 2 * here[j] + after[j]
            place = v + (0.5 * (before[j] - after[j]) / curvature if curvature < 0 else 0.0)
            if core % 2 == 0:
                place -= 0.5
            slot = _slot(out[j, :, 2], count[j], r)
            if slot == MAX_PER_LINE:
                continue
            count[j] = max(count[j], slot + 1)
            out[j, slot, 0], out[j, slot, 1], out[j, slot, 2] = lines[j], place, r
    return _packed(out, count)


@njit
def _summed(
    image: Grey, lines: npt.NDArray[np.uint64], upright: bool, polarity: int
) -> npt.NDArray[np.int32]:
    """Compute cumulative sums (size + 1, lines) of the gray values along every line.

    The outer loop runs over places, so that the image is read in memory order.
    """
    size = image.shape[0] if upright else image.shape[1]
    summed = np.zeros((size + 1, len(lines)), np.int32)
    for v in range(size):
        before, here = summed[v], summed[v + 1]
        pixels = image[v] if upright else image[:, v]
        for j in range(len(lines)):
            here[j] = before[j] + polarity * np.int32(pixels[lines[j]])
    return summed


@njit
def _responses(
    summed: npt.NDArray[np.int32], core: int
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Compute each place's contrast times core x SIDE, and its surroundings times SIDE.

    The third array is the largest contrast of each row. Rows near the image's border are not set.
    """
    response = np.empty((len(summed) - 1, summed.shape[1]), np.int32)
    level, largest = np.empty_like(response), np.zeros(len(response), np.int32)
    margin = core // 2 + GAP + SIDE
    inner, outer = np.int32(core), np.int32(SIDE)
    for v in range(margin, len(response) - margin):
        low = v - core // 2
        high = low + core
        a, b, c = summed[low - GAP - SIDE], summed[low - GAP], summed[low]
        d, e, f = summed[high], summed[high + GAP], summed[high + GAP + SIDE]
        contrast, surroundings, row_largest = response[v], level[v], np.int32(0)
        for j in range(len(contrast)):
            surroundings[j] = max(b[j] - a[j], f[j] - e[j])
            contrast[j] = (d[j] - c[j]) * outer - surroundings[j] * inner
            row_largest = max(row_largest, contrast[j])
        largest[v] = row_largest
    return response, level, largest


@njit
def _slot(strengths: Floats, count: int, strength: float) -> int:
    """Choose a candidate's slot: a free one, the weakest's if weaker, or none: MAX_PER_LINE."""
    if count < MAX_PER_LINE:
        return count
    weakest = 0
    for k in range(1, len(strengths)):
        if strengths[k] < strengths[weakest]:
            weakest = k
    return weakest if strengths[weakest] < strength else MAX_PER_LINE


@njit
def _packed(out: Floats, count: npt.NDArray[np.int64]) -> Floats:
    total = 0
    for j in range(len(count)):
        total += count[j]
    packed = np.empty((total, 3))
    total = 0
    for j in range(len(count)):
        for k in range(count[j]):
            for i in range(3):
                packed[total, i] = out[j, k, i]
            total += 1
    return packed
