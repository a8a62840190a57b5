"""The beam's free end in the image: where its brightness along the path falls to nothing."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from solver.centreline.appearance import Appearance
from solver.centreline.profile_fit import Fits, fit_amplitudes
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats, Grey

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
    if end > len(places) or len(np.unique(places.upright[first:end])) > 1:
        return None
    window = np.arange(first, end)
    # Beyond the last centre the beam goes on straight.
    recent = good[-2 * BEFORE :]
    line = np.polyfit(places.along[recent], fits.centre[recent], 1)
    straight = np.asarray(np.polyval(line, places.along[window]), dtype=np.float64)
    amplitude, variance, ground = fit_amplitudes(
        image, places, window, straight, look.profile, look.noise, look.half, look.full_scale
    )
    if not np.isfinite(amplitude).all():
        return None
    full = float(np.mean(fits.amplitude[told]))
    dark = window[(window > last) & (np.abs(amplitude) < DARK * abs(full))]
    if not len(dark) or dark[0] > last + fading:
        return None
    inside = window <= dark[0] + SPREAD
    after = ~inside & (window <= dark[0] + SPREAD + BEYOND)
    if np.any(np.abs(amplitude[after]) > DARK * abs(full)):
        return None
    before = fits.background[told]
    step = abs(float(np.median(ground[after]) - np.median(before)))
    if step > STEP_SIGMAS * float(before.std()) + 0.5:
        return None
    covered = float(amplitude[inside].sum() / full)
    covered_variance = float(variance[inside].sum()) / full**2
    # Noise among the brightnesses averages out; where a shadow or a light makes them differ by
    # more, that of the end differs from their mean as much.
    scatter = float(np.var(fits.amplitude[told]))
    uneven = max(scatter - float(np.mean(fits.amplitude_sigma[told] ** 2)), 0.0)
    covered_variance += (covered / full) ** 2 * (scatter / len(told) + uneven)
    # What touches the beam near its end adds to all columns alike, or takes from them.
    misfit = fits.chi2[window] / np.maximum(fits.dof[window], 1) / look.misfit
    excess = np.sqrt(variance * np.clip(misfit - WORST_MISFIT, 0, None))
    covered_variance += float(excess[inside & (window <= last)].sum() / full) ** 2
    # What the ground beyond the end imitates of the beam, it also does about the end.
    faded = np.count_nonzero(inside & (window > last))
    covered_variance += faded**2 * float(np.mean((amplitude[after] / full) ** 2))
    forward = 1.0 if places.along[last] >= places.along[told[0]] else -1.0
    along = places.along[first] - forward * 0.5 + forward * covered
    across = float(np.polyval(line, along))
    upright = bool(places.upright[last])
    pixel = np.array([along, across]) if upright else np.array([across, along])
    # Along the beam it was measured; across, the points beside it say all that is known.
    climb = float(line[0])
    tangent = np.array([1.0, climb]) if upright else np.array([climb, 1.0])
    normal = np.array([-tangent[1], tangent[0]]) / np.hypot(*tangent)
    covariance = np.outer(tangent, tangent) * (covered_variance + 0.02**2)
    covariance += np.outer(normal, normal)
    length = float(places.length[first] + (covered - 0.5) * np.hypot(1.0, climb))
    return FoundTip(pixel, covariance, length)
