"""The beam's free end in the image: where its brightness along the path falls to nothing."""

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

# Stations before the end that tell the beam's brightness, and beyond it that tell there is none.
BEFORE, BEYOND = 12, 4
# Columns at the beam's end, whole ones no more, may look like no beam: from the last good one on,
# so many are sought for the first dark one. Lens and pixel spread the end a column beyond that.
FADING, SPREAD = 4, 1
# A column is dark below this share of the beam's brightness.
DARK = 0.25
# The ground may differ by so many times its own scatter, and by rounding.
STEP_SIGMAS = 5.0
# chi^2 per degree of freedom that a column leaves by chance.
WORST_MISFIT = 3.0


@dataclass(frozen=True)
class FoundTip:
    """The tip's pixel (2,), its covariance (2, 2) [px^2], and where it is along the path [px]."""

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
    """The free end, None where it is hidden, out of the image or not told from something else.

    The last good stations tell the brightness; what shines from there on, over that, is by how
    many stations the beam is longer (the area under a step). Before and after, the ground
    must be one ground: at the edge of a thing that hides the beam it is not.
    """
    good = np.flatnonzero(flags == 0)
    if len(good) < BEFORE:
        return None
    last = int(good[-1])
    # Two stations are kept away from the end, which may take part in their brightness.
    told = good[good <= last - 2][-BEFORE:]
    if len(told) < BEFORE // 2 or last - told[0] > 3 * BEFORE:
        return None
    # The end of a thick beam that climbs takes part in many columns.
    fading = FADING + int(look.section.radius)
    first, end = int(told[-1]) + 1, last + fading + SPREAD + BEYOND + 1
    if end > len(places) or (places.upright[first:end] != places.upright[last]).any():
        return None
    window = np.arange(first, end)
    # Beyond the last centre the beam goes on straight.
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
    # Along the beam it was measured; across, the points beside it say all that is known.
    tangent = np.array([1.0, climb]) if upright else np.array([climb, 1.0])
    normal = np.array([-tangent[1], tangent[0]]) / math.hypot(1.0, climb)
    covariance = np.outer(tangent, tangent) * (covered_variance + 0.02**2)
    covariance += np.outer(normal, normal)
    length = float(places.length[first] + (covered - 0.5) * math.hypot(1.0, climb))
    return FoundTip(pixel, covariance, length)


@njit(cache=True, error_model="numpy")
def _straight(x: npt.NDArray[np.int64], y: Floats) -> tuple[float, float]:
    """Slope and level at x = 0 of the straight line through points."""
    x_mean, y_mean = x.mean(), y.mean()
    off = x - x_mean
    slope = (off * (y - y_mean)).sum() / (off * off).sum()
    return slope, y_mean - slope * x_mean


@njit(cache=True, error_model="numpy")
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
    """How many columns of a window (n,) the beam covers, and the variance; infinite where untold.

    `share` is the brightness of the columns over the beam's, `told` that of the columns before;
    the first `whole` columns are up to the last good one.
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
    # Noise among the brightnesses averages out; where a shadow or a light makes them differ by
    # more, that of the end differs from their mean as much.
    scatter = told.var()
    uneven = max(scatter - (told_sigma * told_sigma).mean(), 0.0)
    total += covered * covered * (scatter / len(told) + uneven)
    # What touches the beam near its end adds to all columns alike, or takes from them.
    excess = np.maximum(misfit[:whole] - WORST_MISFIT, 0.0)
    total += np.sqrt(variance[:whole] * excess).sum() ** 2
    # What the ground beyond the end imitates of the beam, it also does about the end.
    total += (end - whole) ** 2 * (beyond * beyond).mean()
    return covered, total
