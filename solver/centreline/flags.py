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
NEIGHBOURHOOD = 61
# Threshold of an amplitude, in its sigmas.
LEAST_SIGNIFICANCE = 5.0
# Threshold of the brightness off its smooth course, relative, and columns of its running median.
ODD, ABOUT = 0.012, 21
# Where two consecutive columns are foreign, this many on either side are rejected too: the edge of
# a shadow or a leaf begins in them.
SPOILT: Final = 3
# Thresholds of a centre's distance from the smooth curve, in sigmas and [px]; outliers exceed both.
FARTHEST_SIGMAS, FARTHEST_PX = 6.0, 0.15


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def follow(
    length: Floats, off_path: Floats, sigma: Floats, share: Floats, on_beam: Mask, flags: Any
) -> Floats:
    """Fit the smooth course (n,) of centres `off_path`, and flag outliers from it as foreign.

    `sigma` (n,) is enlarged in place where the points scatter by more than it states, as they do
    in compressed or processed images. The course has length 0 if too few points are left.
    """
    odd = _oddly_lit(length, share, flags, on_beam)
    flags[(flags == 0) & (odd | ~on_beam)] = FOREIGN
    smooth = curve(length, off_path, np.where(flags == 0, sigma, np.inf), length, DEGREE, CUT)
    if len(smooth) == 0:
        return smooth
    off = off_path - smooth
    good = flags == 0
    sigma *= _understatement(off[good] / sigma[good])
    off = np.abs(off)
    flags[(flags == 0) & (off > FARTHEST_PX) & (off > FARTHEST_SIGMAS * sigma)] = FOREIGN
    running = np.flatnonzero((flags[:-1] == FOREIGN) & (flags[1:] == FOREIGN))
    for i in running:
        about = flags[max(i - SPOILT, 0) : i + SPOILT + 1]
        about[about == 0] = FOREIGN
    return smooth


@njit(cache=True, error_model="numpy")
def _understatement(residual: Floats) -> float:
    """Compute the local scatter of residuals (n,), which are in sigmas; at least 1.

    It is 1 unless white noise would exceed it in fewer than one image of a thousand. The median of
    |x| of n independent values has a relative standard deviation of 1.17 / sqrt(n); the local
    scatter's differences share values, which makes it 1.63 / sqrt(n).
    """
    scatter = local_scatter(residual)
    return scatter if scatter > 1 + 3.1 * 1.63 / np.sqrt(max(len(residual), 1)) else 1.0


@njit(cache=True, error_model="numpy")
def _oddly_lit(length: Floats, share: Floats, flags: Any, on_beam: Mask) -> Mask:
    """Detect columns (n,) where an object shades or lights the beam, by their brightness.

    An object close to the beam takes light from one of its flanks, and shifts its centre.
    """
    odd = np.zeros(len(share), np.bool_)
    place, course = length[on_beam], running_median(share[on_beam], ABOUT)
    known = flags[on_beam] == 0
    usual = curve(place, course, np.where(known, ODD / 3, np.inf), place, 2, 2.5)
    if len(usual) > 0:
        off = np.abs(course / usual - 1)
        # Under spotted light the threshold rises with the typical deviation.
        odd[on_beam] = off > max(ODD, 4.5 * np.median(off[known]))
    return odd
