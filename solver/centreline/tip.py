"""Detection of the beam's free end: where its brightness along the path falls to zero.

The columns about the end say whether there is one, and where. Where the beam's section is known,
the pixels there determine it more precisely: columns that are covered completely or not at all add
noise to the sum.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from solver.centreline.appearance import Appearance
from solver.centreline.beam_end import BeamEnd, Light, StraightBeam, fit_end
from solver.centreline.flags import Columns
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise, pixel_variance
from solver.centreline.profile import Profile, interpolate_column, nearest_table
from solver.centreline.stations import Stations, read_column
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit
from solver.instrument.medians import median
from solver.instrument.transforms import apply

# Number of stations before the end that measure the beam's brightness, and beyond it, to test it.
N_BEFORE, N_BEYOND = 12, 4
# Columns that the beam's end covers in part may be flagged: the first dark column is searched
# within this many after the last good one. Lens and pixel spread the end BLUR_COLUMNS further.
FADE_COLUMNS, BLUR_COLUMNS = 4, 1
# Sigma [px] of the end by columns, and of the fitted end, beside the noise. Both depend on the
# place in the pixel. Chosen: below the noise of one image.
STEP_SIGMA_PX, END_SIGMA_PX = 0.02, 0.007


@dataclass(frozen=True)
class TipEstimate:
    """The tip's pixel (2,), its covariance (2, 2) [px^2], and its distance along the path [px]."""

    pixel: Floats
    covariance: Floats
    length: float


def find_tip(
    image: Grey, places: Stations, columns: Columns, look: Appearance, guide: Guide
) -> TipEstimate | None:
    """Locate the free end; return None where it is hidden, outside the image or ambiguous.

    The last good stations measure the brightness. The sum of light from there on, over that
    brightness, is the number of stations that the beam still covers (the area under a step). The
    background must be the same before and after the end: it changes at the edge of an object that
    hides the beam. A fit to the pixels then improves the place.
    """
    good, fits = np.flatnonzero(columns.flags == 0), columns.fits
    if len(good) < N_BEFORE:
        return None
    last = int(good[-1])
    # A line is fitted to columns, or to rows: their coordinates differ.
    good = good[places.upright[good] == places.upright[last]]
    # The last two stations are excluded: the end may affect their brightness.
    reference = good[good <= last - 2][-N_BEFORE:]
    if len(reference) < N_BEFORE // 2 or last - reference[0] > 3 * N_BEFORE:
        return None
    # The end of a thick, oblique beam extends over many columns.
    fade = FADE_COLUMNS + int(look.section.radius)
    first, end = int(reference[-1]) + 1, last + fade + BLUR_COLUMNS + N_BEYOND + 1
    if end > places.size or (places.upright[first:end] != places.upright[last]).any():
        return None
    # The beam is extrapolated as a straight line beyond the last centre.
    recent = good[-2 * N_BEFORE :]
    climb, level = _fit_line(places.along[recent], fits.centre[recent])
    ahead = places.take(slice(first, end))
    centre = np.asarray(climb * ahead.along + level, dtype=np.float64)
    ground = fits.background[reference]
    light = _light(fits.amplitude[reference], fits.amplitude_sigma[reference], ground)
    table = look.before(light.amplitude, light.background)
    amplitude, variance, background = _fit_amplitudes(
        image, ahead, centre, table, look.noise, look.half, look.full_scale
    )
    misfit = fits.chi2[first:end] / np.maximum(fits.dof[first:end], 1) / look.misfit
    covered, variance = _covered_columns(
        amplitude, variance, background, misfit, last + 1 - first, fade, light, float(ground.std())
    )
    if variance == np.inf:
        return None
    variance += STEP_SIGMA_PX**2
    forward = 1.0 if places.along[last] >= places.along[reference[0]] else -1.0
    along = places.along[first] - forward * 0.5 + forward * covered
    upright = bool(places.upright[last])
    line = StraightBeam(climb, level, forward, upright)
    if not (look.is_sampled or look.faces):
        end_shown = _end(look, table, guide, line, along, places.take(last))
        fit = fit_end(image, line, end_shown, along, light, look.noise, look.full_scale)
        if fit.variance == np.inf:
            return None
        along = fit.along
        variance = fit.variance * max(fit.chi2 / fit.dof, look.misfit) + END_SIGMA_PX**2
    (pixel,) = line.pixels(np.array([along]))
    # Measured along the beam; across it one pixel: the points beside it hold all information.
    tangent = (1.0, climb) if upright else (climb, 1.0)
    stretch = math.hypot(1.0, climb)
    axes = np.array([tangent, (-tangent[1] / stretch, tangent[0] / stretch)])
    covariance = axes.T * (variance, 1.0) @ axes
    length = float(places.length[first] + forward * (along - places.along[first]) * stretch)
    return TipEstimate(pixel, covariance, length)


def _light(amplitude: Floats, sigma: Floats, background: Floats) -> Light:
    """Compute the light near the beam's end from that of n columns.

    Noise averages out. Where a shadow or a light makes the columns differ by more, the brightness
    at the end differs from their mean by as much.
    """
    scatter = float(amplitude.var())
    unexplained = max(scatter - float((sigma * sigma).mean()), 0.0)
    of_mean = math.sqrt(scatter / len(amplitude) + unexplained)
    return Light(float(amplitude.mean()), of_mean, median(background))


def _end(
    look: Appearance,
    profile: Profile,
    guide: Guide,
    line: StraightBeam,
    along: float,
    last: Stations,
) -> BeamEnd:
    """Describe the end of a beam in plane C, whose `last` station is near a place `along`."""
    table = nearest_table(profile, float(last.length))
    brightness, radius = profile.brightness[table], float(profile.radius[table])
    pixels = line.pixels(np.array([along - line.forward, along]))
    in_plane = np.column_stack([guide.places(pixels), np.zeros(2)])
    before, tip = apply(guide.antenna_from_beam, in_plane)
    (towards,) = guide.camera.directions_from(tip[None])
    return BeamEnd(
        brightness=np.ascontiguousarray(brightness[:: int(last.sense)]),
        spread=look.section.spread,
        radius=radius,
        # A beam that is seen from the side ends in a straight line.
        bulge=radius * abs(float((tip - before) @ towards / np.linalg.norm(tip - before))),
    )


@njit
def _fit_line(x: npt.NDArray[np.int64], y: Floats) -> tuple[float, float]:
    """Fit a straight line to points; return its slope and its level at x = 0."""
    x_mean = y_mean = 0.0
    for i in range(len(x)):
        x_mean, y_mean = x_mean + x[i] / len(x), y_mean + y[i] / len(x)
    xx = xy = 0.0
    for i in range(len(x)):
        xx, xy = xx + (x[i] - x_mean) ** 2, xy + (x[i] - x_mean) * (y[i] - y_mean)
    return xy / xx, y_mean - xy / xx * x_mean


@njit
def _fit_amplitudes(
    image: Grey,
    places: Stations,
    centre: Floats,
    profile: Profile,
    noise: Noise,
    half: int,
    full_scale: int,
) -> Any:
    """Fit amplitude and background at n stations where the `centre` (n,) [px] is known.

    Return amplitude, its variance and background, each (n,); NaN where the image ends.
    """
    n, size = len(centre), 2 * half + 1
    out = np.full((3, n), np.nan)
    gray, weight, p = np.empty(size), np.empty(size), np.empty(size)
    for i in range(n):
        first = int(np.rint(centre[i])) - half
        if not read_column(image, places.along[i], places.upright[i], first, gray):
            continue
        # Equal weights: with weights by noise, the dark side of a column that the beam's end cuts
        # in two would weigh more than the bright one, and the estimated end would be too near.
        for k in range(size):
            weight[k] = 0.0 if gray[k] >= full_scale else 1.0
        table = profile.value[nearest_table(profile, places.length[i])]
        interpolate_column(table, abs(places.climb[i]), places.sense[i], first - centre[i], p)
        p0, p1 = _ground(weight, p, half)
        norm = product = noise_sum = 0.0
        for k in range(size):
            residual = weight[k] * (p[k] - p0 - p1 * (k - half))
            norm += residual * p[k]
            product += residual * gray[k]
            noise_sum += residual * residual * pixel_variance(noise, gray[k])
        g0, _ = _ground(weight, gray, half)
        a = product / norm
        out[0, i], out[1, i], out[2, i] = a, noise_sum / norm**2, g0 - a * p0
    return out[0], out[1], out[2]


@njit
def _ground(weight: Floats, values: Floats, half: int) -> tuple[float, float]:
    """Fit a weighted straight line to values; return its value at the middle and its slope."""
    w0 = w1 = w2 = v0 = v1 = 0.0
    for k in range(len(values)):
        x = k - half
        w0 += weight[k]
        w1 += weight[k] * x
        w2 += weight[k] * x * x
        v0 += weight[k] * values[k]
        v1 += weight[k] * values[k] * x
    det = w0 * w2 - w1 * w1
    return (w2 * v0 - w1 * v1) / det, (w0 * v1 - w1 * v0) / det


@njit
def _covered_columns(
    amplitude: Floats,
    amplitude_variance: Floats,
    background: Floats,
    misfit: Floats,
    n_good: int,
    fade: int,
    light: Light,
    background_sigma: float,
) -> tuple[float, float]:
    """Estimate how many columns of a window (n,) the beam covers, and the variance.

    The variance is infinite where the end is ambiguous. `light` is that of the columns before, and
    `background_sigma` the scatter of its background; the first `n_good` columns are those up to the
    last good one.
    """
    ambiguous = 0.0, np.inf
    brightness = amplitude / light.amplitude
    variance = amplitude_variance / light.amplitude**2
    dark = n_good
    while dark < len(brightness) and not abs(brightness[dark]) < THRESHOLDS.dark_fraction:
        dark += 1
    if dark > n_good + fade - 1 or not np.isfinite(brightness).all():
        return ambiguous
    end = dark + BLUR_COLUMNS + 1
    beyond = brightness[end : end + N_BEYOND]
    if (np.abs(beyond) > THRESHOLDS.dark_fraction).any():
        return ambiguous
    step = abs(median(background[end : end + N_BEYOND]) - light.background)
    if step > THRESHOLDS.max_step_sigmas * background_sigma + 0.5:
        return ambiguous
    covered, total_variance = brightness[:end].sum(), variance[:end].sum()
    total_variance += (covered * light.sigma / light.amplitude) ** 2
    # An object that touches the beam near its end biases all columns in the same direction.
    excess = np.maximum(misfit[:n_good] - THRESHOLDS.max_tip_misfit, 0.0)
    total_variance += np.sqrt(variance[:n_good] * excess).sum() ** 2
    # Background that looks like the beam beyond the end does so at the end, too.
    total_variance += (end - n_good) ** 2 * (beyond * beyond).mean()
    return covered, total_variance
