"""What along a path does not look like the beam at rest: flagged column by column, compiled."""

from typing import Any, Final

import numpy as np

from solver.centreline.smooth import CUT, DEGREE, curve, local_scatter, running_median
from solver.instrument.arrays import Floats, Mask
from solver.instrument.centreline import Flag
from solver.instrument.compiled import njit

HIDDEN, SATURATED, FOREIGN = (int(flag) for flag in (Flag.HIDDEN, Flag.SATURATED, Flag.FOREIGN))
# Times the amplitude at rest within which a column's amplitude may lie.
DIMMEST, BRIGHTEST = 0.4, 2.2
# chi^2 per degree of freedom, over what is typical at rest, that a column may leave: of seven
# degrees of freedom one in 300 leaves more.
WORST_MISFIT = 3.0
NEIGHBOURHOOD = 61
# An amplitude of fewer of its sigmas is none.
LEAST_SIGNIFICANCE = 5.0
# A brightness off its smooth course by this share, over the median of so many columns, is odd.
ODD, ABOUT = 0.012, 21
# Where two columns running are foreign, so many on either side are not trusted either: a shadow's
# or a leaf's edge begins in them.
SPOILT: Final = 3
# A centre may lie this many of its sigmas, and this far [px], off the smooth curve of all.
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
    """Flags (n,) of columns, each by itself and its neighbours; 0 of those that look like the beam.

    `share` is a column's brightness over that at rest, `misfit` its chi^2 per degree of freedom
    over what is typical at rest; the others are as in `Fits`.
    """
    # A beam that comes nearer to the camera looks wider than at rest, all along: what is
    # foreign differs from the columns about it.
    usual = running_median(np.minimum(misfit, 30.0), NEIGHBOURHOOD)
    # On a rough ground every column leaves more, and is known that much less.
    plausible = misfit[(share > DIMMEST) & (share < BRIGHTEST)]
    rough = max(np.median(plausible), 1.0) if len(plausible) > 0 else 1.0
    flags = np.zeros(len(share), np.uint8)
    for i in range(len(share)):
        # In a rough ground a beam must stand out all the more.
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
    """Fit the smooth course (n,) of centres `off_path` and flag the points off it as foreign.

    `sigma` (n,) is enlarged in place where the points scatter by more than it states, as they do
    in compressed or processed images. The course has length 0 where too few points are left.
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
    """Ratio of the local scatter of residuals (n,), in sigmas, to 1; at least 1.

    It counts only where white noise would not show as much in one image of a thousand. Of n
    independent values the median of |x| has a relative standard deviation of 1.17 / sqrt(n); the
    local scatter's differences share values, which makes it 1.63 / sqrt(n).
    """
    scatter = local_scatter(residual)
    return scatter if scatter > 1 + 3.1 * 1.63 / np.sqrt(max(len(residual), 1)) else 1.0


@njit(cache=True, error_model="numpy")
def _oddly_lit(length: Floats, share: Floats, flags: Any, on_beam: Mask) -> Mask:
    """Where something keeps light from the beam, or adds to it: brighter or darker than about.

    What is close to the beam takes light from one of its flanks, and moves its centre.
    """
    odd = np.zeros(len(share), np.bool_)
    place, course = length[on_beam], running_median(share[on_beam], ABOUT)
    known = flags[on_beam] == 0
    usual = curve(place, course, np.where(known, ODD / 3, np.inf), place, 2, 2.5)
    if len(usual) > 0:
        off = np.abs(course / usual - 1)
        # Under a spotted light every place is odd, and none.
        odd[on_beam] = off > max(ODD, 4.5 * np.median(off[known]))
    return odd
