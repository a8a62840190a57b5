"""Gray profile of a pixel column across the beam: disc section x point spread x pixel.

Let x be the distance from the axis over the radius. The brightness of a matt cylinder lit from the
front is proportional to the chord of its disc, sqrt(1 - x^2). Lit from everywhere, it is almost
even; with gloss, it is narrower: both are powers of the chord. Light from one side tilts the
profile. The lens blurs it by a Gaussian, the pixel averages it. A beam that crosses the pixel
columns obliquely is wider along them, and each column averages its rise or fall.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from solver.instrument.arrays import Floats

# The table's step along a column [px], and its number of slopes, from the rows to the diagonal.
STEP = 1 / 64
SLOPES = 17
# Strips across the section.
_STRIPS = 32


@dataclass(frozen=True)
class Section:
    """How the beam's section appears: `radius` [px], Gaussian `spread` [px], and its shading.

    `roundness` is the power of the chord, 0 for an even band; `skew` tilts the brightness across
    the section, positive where the side of larger pixel coordinates is brighter.
    """

    radius: float
    spread: float
    roundness: float
    skew: float


@dataclass(frozen=True)
class Profile:
    """Table of the profile: `value` and `slope` [1/px] (SLOPES, n) along a pixel column.

    Row i is for a beam that climbs i / (SLOPES - 1) px per column; the middle of a row is the axis;
    its sum times STEP is one over the cosine of the climb, so that amplitudes are comparable.
    `reach` [px] is that of the table.
    """

    value: Floats
    slope: Floats
    reach: float


def profile(section: Section) -> Profile:
    """Tabulate a section's profiles."""
    extent = 1.5 * section.radius + 5 * section.spread * 1.5 + 1.5
    # An oblique section is the same one, only wider: it is computed once, on a finer grid.
    fine = _fine_grid(extent)
    return _tabulated(fine, _spread(fine, section))


def spline_profile(values: Floats, step: float, reach: float) -> Profile:
    """Tabulate the profiles of a linear spline across the beam.

    Its `values` are at knots `step` [px] apart, the middle one on the axis, and 0 beyond. The table
    extends `reach` [px] to both sides, and what obliqueness and the pixel add to it.
    """
    fine = _fine_grid(1.5 * reach + 1.5)
    last = len(values) // 2 + 1
    knots = step * np.arange(-last, last + 1)
    return _tabulated(fine, np.interp(fine, knots, np.concatenate([[0.0], values, [0.0]])))


def interpolated(table: Floats, climb: Floats, offset: Floats) -> Floats:
    """Interpolate a table of profiles at offsets (n, m) [px] from the beam, for climbs (n, 1)."""
    slopes, size = table.shape
    row = climb * (slopes - 1)
    low = np.minimum(row.astype(np.int64), slopes - 2)
    column = offset / STEP + size // 2
    first = np.clip(np.floor(column).astype(np.int64), 0, size - 2)
    inside = (column >= 0) & (column < size - 1)
    fraction, row_fraction = column - first, row - low
    flatter = (1 - fraction) * table[low, first] + fraction * table[low, first + 1]
    steeper = (1 - fraction) * table[low + 1, first] + fraction * table[low + 1, first + 1]
    return np.asarray(np.where(inside, (1 - row_fraction) * flatter + row_fraction * steeper, 0.0))


def _fine_grid(extent: float) -> Floats:
    half = 4 * int(np.ceil(extent / STEP))
    return np.arange(-half, half + 1, dtype=np.float64) * (STEP / 4)


def _tabulated(fine: Floats, blurred: Floats) -> Profile:
    """Tabulate the profiles of a brightness across the beam, on a grid of step STEP / 4."""
    t = fine[::4]
    values = np.empty((SLOPES, len(t)))
    slopes = np.empty_like(values)
    for index, climb in enumerate(np.linspace(0, 1, SLOPES)):
        stretch = float(np.hypot(1, climb))
        # The double integral of the section, differenced over the pixel's height and width,
        # is its mean over the pixel: exact however narrow the section is.
        smooth = np.interp(t / stretch, fine, blurred) / stretch
        averaged = _mean_over(t, smooth, climb) if climb > 0 else smooth
        above, below = np.interp(t + 0.5, t, averaged), np.interp(t - 0.5, t, averaged)
        slopes[index] = (above - below) * stretch
        values[index] = _mean_over(t, averaged, 1.0) * stretch
    return Profile(values, slopes, float(t[-1]))


def _spread(t: Floats, section: Section) -> Floats:
    """Compute section x point spread across the beam, of unit area, at t [px]."""
    x = _strips()
    brightness = (1 - x**2) ** (section.roundness / 2) * (1 + section.skew * x)
    return _blurred(t, section, brightness / brightness.sum())


def _strips() -> Floats:
    """Compute the midpoints of strips of equal width across the section, over its radius."""
    edges = np.linspace(-1, 1, _STRIPS + 1)
    return np.asarray((edges[1:] + edges[:-1]) / 2)


def _blurred(t: Floats, section: Section, brightness: Floats) -> Floats:
    """Blur strips with this brightness across the section, each in closed form, at t [px]."""
    edges = np.linspace(-1, 1, _STRIPS + 1)
    cumulative = ndtr((t[:, None] - section.radius * edges) / max(section.spread, 1e-3))
    return np.asarray(
        (cumulative[:, :-1] - cumulative[:, 1:]) @ brightness * (_STRIPS / (2 * section.radius))
    )


def _mean_over(t: Floats, values: Floats, width: float) -> Floats:
    """Average tabulated values over a window of `width` [px] about every t."""
    integral = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)]) * STEP
    upper, lower = np.interp(t + width / 2, t, integral), np.interp(t - width / 2, t, integral)
    return np.asarray((upper - lower) / width)


def tilt_response(table: Profile, section: Section, weights: Floats, half: int) -> float:
    """Compute the shift of a fitted profile whose brightness tilts, over that of its middle.

    A profile fit weights the steep sides of a wide beam, which a tilt moves less than the middle of
    its brightness. `weights` (2,) are the variance of a pixel beside the beam, and that on the beam
    over the profile's value; `half` pixels on either side are fitted.
    """
    value, slope = table.value[0], table.slope[0]
    t = STEP * (np.arange(len(value)) - len(value) // 2)
    fitted = np.abs(t) <= half
    fine = _fine_grid(float(t[-1]) + 1.0)
    tilt = _mean_over(fine[::4], _blurred(fine, section, _strips())[::4], 1.0)
    tilt = np.interp(t, fine[::4], tilt)
    tilt /= STEP * (t @ tilt)
    # Background, its slope, amplitude and centre are fitted.
    design = np.column_stack([np.ones_like(t), t, value, slope])[fitted]
    sigma = np.sqrt(weights[0] + weights[1] * np.maximum(value[fitted], 0.0))
    shift = np.linalg.lstsq(design / sigma[:, None], tilt[fitted] / sigma)[0][3]
    return float(-shift)
