"""Where in a pixel column something thin stands out on both sides: candidates for the beam."""

import numpy as np
import numpy.typing as npt
from numba import njit

from solver.centreline.noise import ROUNDING, Noise
from solver.instrument.arrays import Floats, Grey

# The strongest places of a column that are kept.
MOST = 6
# A place must stand out by this many sigmas of the noise.
LEAST_SIGNIFICANCE = 5.0


def candidates(
    image: Grey,
    lines: npt.NDArray[np.int64],
    upright: bool,
    core: int,
    polarity: int,
    noise: Noise,
) -> Floats:
    """Rows (m, 4): line, place [px], by how much it stands out [gray], and its sigma.

    `lines` are pixel columns, or rows where not `upright`. The mean of `core` pixels must exceed
    the higher of the means on its two sides (fall short of the lower, where `polarity` is -1), so
    that edges, which are higher than one side only, are no candidates. Places are refined by a
    parabola.
    """
    return np.asarray(
        _scan(image, lines, upright, core, polarity, noise.dark, noise.per_gray),
        dtype=np.float64,
    )


@njit(cache=True, error_model="numpy")
def _scan(
    image: Grey,
    lines: npt.NDArray[np.int64],
    upright: bool,
    core: int,
    polarity: int,
    dark: float,
    per_gray: float,
) -> Floats:
    size = image.shape[0] if upright else image.shape[1]
    side, gap = 2, 1
    reach = core // 2 + gap + side
    out = np.empty((len(lines) * MOST, 4))
    total = 0
    summed = np.zeros(size + 1)
    response = np.zeros(size)
    level = np.zeros(size)
    for line in lines:
        for v in range(size):
            gray = float(image[v, line]) if upright else float(image[line, v])
            summed[v + 1] = summed[v] + polarity * gray
        for v in range(reach, size - reach):
            low = v - core // 2
            middle = (summed[low + core] - summed[low]) / core
            before = (summed[low - gap] - summed[low - gap - side]) / side
            after = (summed[low + core + gap + side] - summed[low + core + gap]) / side
            level[v] = max(before, after)
            response[v] = middle - level[v]
        found = 0
        for v in range(reach + 1, size - reach - 1):
            r = response[v]
            if r <= 0 or r < response[v - 1] or r <= response[v + 1]:
                continue
            gray = abs(level[v]) + r / 2
            variance = max(dark + per_gray * gray, ROUNDING) * (1.0 / core + 1.0 / side)
            if r * r < LEAST_SIGNIFICANCE**2 * variance:
                continue
            bend = response[v - 1] - 2 * r + response[v + 1]
            place = v + (0.5 * (response[v - 1] - response[v + 1]) / bend if bend < 0 else 0.0)
            if core % 2 == 0:
                place -= 0.5
            if found < MOST:
                slot = total + found
                found += 1
            else:
                slot = total
                for k in range(total + 1, total + MOST):
                    if out[k, 2] < out[slot, 2]:
                        slot = k
                if out[slot, 2] >= r:
                    continue
            out[slot, 0] = line
            out[slot, 1] = place
            out[slot, 2] = r
            out[slot, 3] = np.sqrt(variance)
        total += found
    return out[:total].copy()
