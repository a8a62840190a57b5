"""Flags of the columns along a path that do not look like the beam at rest; compiled."""

from typing import Any, Final

import numpy as np

from solver.centreline.smooth import CUT, DEGREE, curve, local_scatter, running_median
from solver.instrument.arrays import Floats, Mask
from solver.instrument.centreline import Flag
from solver.instrument.compiled import njit

HIDDEN, SATURATED, FOREIGN = (int(flag) for flag in (Flag.HIDDEN, Flag.SATURATED, Flag.FOREIGN))
# Allowed range of a column's amplitude, over the amplitude at rest.
DIMMEST, BRIGHTEST = 0.4, 2.2
# Threshold of a column's chi^2 per degree of freedom, over the typical value at rest: with seven
# degrees of freedom one column in 300 exceeds it.
WORST_MISFIT = 3.0
NEIGHBOURHOOD = np.int64(61)
# Threshold of an amplitude, in its sigmas.
LEAST_SIGNIFICANCE = 5.0
# Threshold of the brightness off its smooth course, relative, and columns of its running median.
ODD, ABOUT = 0.012, np.int64(21)
# Degree of the brightness's smooth course. Numpy scalars are compiled once, literals anew.
_BRIGHTNESS_DEGREE = np.int64(2)
# Where two consecutive columns are foreign, this many on either side are rejected too: the edge of
# a shadow or a leaf begins in them.
SPOILT: Final = 3
# Thresholds of a centre's distance from the smooth curve, in sigmas and [px]; outliers exceed both.
FARTHEST_SIGMAS, FARTHEST_PX = 6.0, 0.15


@njit
def flags_of(
    share: Floats,
    misfit: Floats,
    sigma: Floats,
    amplitude: Floats,
    amplitude_sigma: Floats,
    saturated: Any,
) -> Any:
    """Flag columns (n,) by their own fit and their neighbours; 0 if they look like the beam.

    `share` is a column's brightness over that at rest, `misfit` its chi^2 per degree of freedom
    over what is typical at rest; the others are as in `Fits`.
    """
    # A beam that comes nearer to the camera looks wider than at rest in all columns: a foreign
    # object differs from the columns about it.
    usual = running_median(np.minimum(misfit, 30.0), NEIGHBOURHOOD)
    # A textured background raises the misfit of every column.
    plausible = misfit[(share > DIMMEST) & (share < BRIGHTEST)]
    rough = max(np.median(plausible), 1.0) if len(plausible) > 0 else 1.0
    flags = np.zeros(len(share), np.uint8)
    for i in range(len(share)):
        # On a textured background the amplitude must exceed a larger threshold.
        doubt = amplitude_sigma[i] * np.sqrt(max(misfit[i], 1.0))
        faint = share[i] < DIMMEST or abs(amplitude[i]) < LEAST_SIGNIFICANCE * doubt
        if faint or not np.isfinite(sigma[i]):
            flags[i] = HIDDEN
        elif share[i] > BRIGHTEST or misfit[i] > WORST_MISFIT * max(usual[i], rough):
            flags[i] = FOREIGN
        if flags[i] > 0 and saturated[i] > 0:
            flags[i] = SATURATED
    return flags


@njit
def follow(
    length: Floats, off_path: Floats, sigma: Floats, share: Floats, on_beam: Mask, flags: Any
) -> Floats:
    """Fit the smooth course (n,) of centres `off_path`, and flag outliers from it as foreign.

    `sigma` (n,) is enlarged in place where the points scatter by more than it states, as they do
    in compressed or processed images. The course has length 0 if too few points are left.
    """
    n = len(length)
    odd = _oddly_lit(length, share, flags, on_beam)
    known_sigma, residual = np.full(n, np.inf), np.empty(n)
    for i in range(n):
        if flags[i] == 0 and (odd[i] or not on_beam[i]):
            flags[i] = FOREIGN
        if flags[i] == 0:
            known_sigma[i] = sigma[i]
    smooth = curve(length, off_path, known_sigma, length, DEGREE, CUT)
    if len(smooth) == 0:
        return smooth
    good = 0
    for i in range(n):
        if flags[i] == 0:
            residual[good] = (off_path[i] - smooth[i]) / sigma[i]
            good += 1
    understatement = _understatement(residual[:good])
    for i in range(n):
        sigma[i] *= understatement
        off = abs(off_path[i] - smooth[i])
        if flags[i] == 0 and off > max(FARTHEST_PX, FARTHEST_SIGMAS * sigma[i]):
            flags[i] = FOREIGN
    # Marked apart: a column that is rejected here does not spoil others.
    spoilt = np.zeros(n, np.bool_)
    for i in range(n - 1):
        if flags[i] == FOREIGN and flags[i + 1] == FOREIGN:
            spoilt[max(i - SPOILT, 0) : i + SPOILT + 1] = True
    for i in range(n):
        if spoilt[i] and flags[i] == 0:
            flags[i] = FOREIGN
    return smooth


@njit
def _understatement(residual: Floats) -> float:
    """Compute the local scatter of residuals (n,), which are in sigmas; at least 1.

    It is 1 unless white noise would exceed it in fewer than one image of a thousand. The median of
    |x| of n independent values has a relative standard deviation of 1.17 / sqrt(n); the local
    scatter's differences share values, which makes it 1.63 / sqrt(n).
    """
    scatter = local_scatter(residual)
    return scatter if scatter > 1 + 3.1 * 1.63 / np.sqrt(max(len(residual), 1)) else 1.0


@njit
def _oddly_lit(length: Floats, share: Floats, flags: Any, on_beam: Mask) -> Mask:
    """Detect columns (n,) where an object shades or lights the beam, by their brightness.

    An object close to the beam takes light from one of its flanks, and shifts its centre.
    """
    odd, count = np.zeros(len(share), np.bool_), 0
    index = np.empty(len(share), np.int64)
    place, light, sigma = np.empty(len(share)), np.empty(len(share)), np.empty(len(share))
    for i in range(len(share)):
        if on_beam[i]:
            index[count], place[count], light[count] = i, length[i], share[i]
            sigma[count] = ODD / 3 if flags[i] == 0 else np.inf
            count += 1
    course = running_median(light[:count], ABOUT)
    usual = curve(place[:count], course, sigma[:count], place[:count], _BRIGHTNESS_DEGREE, 2.5)
    if len(usual) > 0:
        off, known = np.empty(count), 0
        for k in range(count):
            if np.isfinite(sigma[k]):
                off[known] = abs(course[k] / usual[k] - 1)
                known += 1
        # Under spotted light the threshold rises with the typical deviation.
        allowed = max(ODD, 4.5 * np.median(off[:known]))
        for k in range(count):
            odd[index[k]] = abs(course[k] / usual[k] - 1) > allowed
    return odd
