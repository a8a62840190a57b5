"""Detection of the beam's free end: where its brightness along the path falls to zero."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from solver.centreline.amplitude import fit_amplitudes
from solver.centreline.appearance import Appearance
from solver.centreline.profile_fit import Fits
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit

# Number of stations that measure the beam's brightness, and of those beyond its end, which test it.
BEFORE, BEYOND = 12, 4
# Columns that the beam's end covers in part may be flagged: the first dark column is searched
# within this many after the last good one. Lens and pixel spread the end SPREAD columns further.
FADING, SPREAD = 4, 1
# A column is dark below this share of the beam's brightness.
DARK = 0.25
# Threshold of the background's change at the end, in its own scatter; rounding is added.
STEP_SIGMAS = 5.0
# Largest chi^2 per degree of freedom of a column by chance.
WORST_MISFIT = 3.0


@dataclass(frozen=True)
class FoundTip:
    """The tip's pixel (2,), its covariance (2, 2) [px^2], and its distance along the path [px]."""

    pixel: Floats
    covariance: Floats
    length: float


def find_tip(
    image: Grey,
    places: Stations,
    flags: npt.NDArray[np.uint8],
    fits: Fits,
    look: Appearance,
) -> FoundTip | None:
    """Locate the free end; return None where it is hidden, outside the image or ambiguous.

    The last good stations measure the brightness. The sum of light from there on, over that
    brightness, is the number of stations that the beam still covers (the area under a step). The
    background must be the same before and after: at the edge of an object that hides the beam it
    is not.
    """
    good = np.flatnonzero(flags == 0)
    if len(good) < BEFORE:
        return None
    last = int(good[-1])
    # Two stations are kept away from the end, which may affect their brightness.
    told = good[good <= last - 2][-BEFORE:]
    if len(told) < BEFORE // 2 or last - told[0] > 3 * BEFORE:
        return None
    # The end of a thick, oblique beam extends over many columns.
    fading = FADING + int(look.section.radius)
    first, end = int(told[-1]) + 1, last + fading + SPREAD + BEYOND + 1
    if end > len(places) or (places.upright[first:end] != places.upright[last]).any():
        return None
    window = np.arange(first, end)
    # The beam is extrapolated as a straight line beyond the last centre.
    recent = good[-2 * BEFORE :]
    climb, level = _straight(places.along[recent], fits.centre[recent])
    amplitude, variance, ground = fit_amplitudes(
        image,
        places,
        window,
        np.asarray(climb * places.along[window] + level, dtype=np.float64),
        look.profile,
        look.noise,
        look.half,
        look.full_scale,
    )
    full = float(np.mean(fits.amplitude[told]))
    covered, covered_variance = _covered(
        amplitude / full,
        variance / full**2,
        ground,
        fits.chi2[window] / np.maximum(fits.dof[window], 1) / look.misfit,
        last + 1 - first,
        fading,
        fits.amplitude[told] / full,
        fits.amplitude_sigma[told] / full,
        fits.background[told],
    )
    if covered_variance == np.inf:
        return None
    forward = 1.0 if places.along[last] >= places.along[told[0]] else -1.0
    along = places.along[first] - forward * 0.5 + forward * covered
    across = climb * along + level
    upright = bool(places.upright[last])
    pixel = np.array([along, across]) if upright else np.array([across, along])
    # Measured along the beam; across it one pixel: the points beside it hold all information.
    tangent = np.array([1.0, climb]) if upright else np.array([climb, 1.0])
    normal = np.array([-tangent[1], tangent[0]]) / math.hypot(1.0, climb)
    covariance = np.outer(tangent, tangent) * (covered_variance + 0.02**2)
    covariance += np.outer(normal, normal)
    length = float(places.length[first] + (covered - 0.5) * math.hypot(1.0, climb))
    return FoundTip(pixel, covariance, length)


@njit
def _straight(x: npt.NDArray[np.int64], y: Floats) -> tuple[float, float]:
    """Fit a straight line to points; return its slope and its level at x = 0."""
    x_mean, y_mean = x.mean(), y.mean()
    off = x - x_mean
    slope = (off * (y - y_mean)).sum() / (off * off).sum()
    return slope, y_mean - slope * x_mean


@njit
def _covered(
    share: Floats,
    variance: Floats,
    ground: Floats,
    misfit: Floats,
    whole: int,
    fading: int,
    told: Floats,
    told_sigma: Floats,
    told_ground: Floats,
) -> tuple[float, float]:
    """Estimate how many columns of a window (n,) the beam covers, and the variance.

    The variance is infinite where the end is ambiguous. `share` is the brightness of the columns
    over the beam's, `told` that of the columns before; the first `whole` columns are up to the last
    good one.
    """
    untold = 0.0, np.inf
    dark = whole
    while dark < len(share) and not abs(share[dark]) < DARK:
        dark += 1
    if dark > whole + fading - 1 or not np.isfinite(share).all():
        return untold
    end = dark + SPREAD + 1
    beyond = share[end : end + BEYOND]
    if (np.abs(beyond) > DARK).any():
        return untold
    step = abs(np.median(ground[end : end + BEYOND]) - np.median(told_ground))
    if step > STEP_SIGMAS * told_ground.std() + 0.5:
        return untold
    covered, total = share[:end].sum(), variance[:end].sum()
    # Noise of the brightnesses averages out. Where a shadow or a light makes them differ by more,
    # the brightness at the end differs from their mean by as much.
    scatter = told.var()
    uneven = max(scatter - (told_sigma * told_sigma).mean(), 0.0)
    total += covered * covered * (scatter / len(told) + uneven)
    # An object that touches the beam near its end biases all columns in the same direction.
    excess = np.maximum(misfit[:whole] - WORST_MISFIT, 0.0)
    total += np.sqrt(variance[:whole] * excess).sum() ** 2
    # Background that looks like the beam beyond the end does so at the end, too.
    total += (end - whole) ** 2 * (beyond * beyond).mean()
    return covered, total
