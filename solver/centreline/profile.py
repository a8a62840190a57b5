"""Gray profile of a pixel column across the beam: disc section x point spread x pixel.

Let x be the distance from the axis over the radius. The brightness of a matt cylinder lit from the
front is proportional to the chord of its disc, sqrt(1 - x^2). Lit from everywhere, it is almost
even; with gloss, it is narrower: both are powers of the chord. Light from one side tilts the
profile. The lens blurs it by a Gaussian, the pixel averages it. A beam that crosses the pixel
columns obliquely is wider along them, and each column averages its rise or fall.

A beam that gets thinner towards its tip has a table for each of several widths, and every column
is read with the nearest one.

A section describes the beam's contrast with its ground. Before grounds that differ, it is the
section of the beam's own light, and `cover` tabulates what the beam hides: the contrast is the one
less the other.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# The table's step along a column [px], and its number of slopes, from the rows to the diagonal.
STEP = 1 / 64
SLOPES = 17
# Largest skew of a contrast's section, of which no side is dark, and of a beam's own light. Chosen:
# the latter is lit from 72 degrees to the side.
MAX_SKEW, MAX_OWN_SKEW = 0.9, 3.0
# Strips across the section.
_STRIPS = 32
# Number of tables of a tapered beam. Chosen: where two pixels taper to one, half a step moves an
# edge by a hundredth of a pixel, which is less than the noise of one column does.
TAPERED_TABLES = 17


@dataclass(frozen=True)
class Section:
    """How the beam's section appears: `radius` [px], Gaussian `spread` [px], and its shading.

    `roundness` is the power of the chord, 0 for an even band; `skew` tilts the brightness across
    the section, up to MAX_SKEW, or MAX_OWN_SKEW of its own light, positive where the side of larger
    pixel coordinates is brighter. `taper` is the difference of the radii at the tip and at the
    clamp, over `radius`, which is that in the middle.
    """

    radius: float
    spread: float
    roundness: float
    skew: float
    taper: float = 0.0

    @property
    def reach(self) -> float:
        """Largest distance [px] of pixels that show the beam from a path half a pixel beside it."""
        widest = self.radius * (1 + abs(self.taper) / 2)
        return widest + 2.5 * self.spread + 0.5

    @property
    def resolution(self) -> float:
        """Sigma [px] of the place of a profile whose amplitude is the least that shows a beam.

        That of a Gaussian is sqrt(2) of its width, over the ratio of the amplitude to its sigma.
        The width is that of a matt beam, the blur and a pixel together.
        """
        width = np.sqrt(self.radius**2 / 4 + self.spread**2 + 1 / 12)
        return float(np.sqrt(2) * width / THRESHOLDS.amplitude_sigmas)


class Profile(NamedTuple):
    """Tables of the profile: `value` and `slope` [1/px] (k, SLOPES, n) along a pixel column.

    Table j is for the section whose `radius` (k,) [px] is the j-th, from the clamp to the tip. Row
    i is for a beam that climbs i / (SLOPES - 1) px per column; the middle of a row is the axis; its
    sum times STEP is one over the cosine of the climb, so that amplitudes are comparable.
    `brightness` (k, n) [1/px] is what the pixels average, across the beam. `length` [px] is that of
    the beam along its path. `cover` is the profile of the same beam with an even brightness, which
    its share of the pixels is, over its width; None for a profile of the contrast.
    """

    value: Floats
    slope: Floats
    brightness: Floats
    radius: Floats
    length: float
    cover: "Profile | None" = None


def profile(section: Section, length: float = 1.0) -> Profile:
    """Tabulate the profiles of the contrast of a beam with this section, `length` [px] long."""
    x = _strips()
    shade = (1 - x**2) ** (section.roundness / 2) * (1 + section.skew * x)
    return _of_strips(section, shade, length)


def own_light(section: Section, length: float = 1.0) -> Profile:
    """Tabulate the profiles of the light of a beam with this section, and of what it hides.

    A matt cylinder is as bright as the cosine of the angle between its surface's normal and the
    light: that of light from one side adds to that from the front (Lambert 1760).
    """
    x = _strips()
    shade = np.maximum((1 - x**2) ** (section.roundness / 2) + section.skew * x, 0.0)
    cover = _of_strips(section, np.ones_like(x), length)
    return _of_strips(section, shade, length)._replace(cover=cover)


def contrast_before(table: Profile, contrast: float, ground: float) -> Profile:
    """Compute the profile of the contrast with a ground from one of the beam's own light.

    `contrast` is the beam's mean gray value less that of the ground, and `ground` the latter. A
    profile without a cover is returned as it is.
    """
    cover = table.cover
    if cover is None:
        return table
    own, hidden = (contrast + ground) / contrast, ground / contrast
    return table._replace(
        value=own * table.value - hidden * cover.value,
        slope=own * table.slope - hidden * cover.slope,
        brightness=own * table.brightness - hidden * cover.brightness,
        cover=None,
    )


def spline_profile(values: Floats, step: float, reach: float) -> Profile:
    """Tabulate the profiles of a linear spline across the beam.

    Its `values` are at knots `step` [px] apart, the middle one on the axis, and 0 beyond. The table
    extends `reach` [px] to both sides, and what obliqueness and the pixel add to it.
    """
    fine = _fine_grid(1.5 * reach + 1.5)
    last = len(values) // 2 + 1
    knots = step * np.arange(-last, last + 1)
    across = np.interp(fine, knots, np.concatenate([[0.0], values, [0.0]]))
    value, slope = _tabulated(fine, across)
    return Profile(value[None], slope[None], across[None, ::4], np.array([reach]), 1.0)


@njit
def nearest_table(profile: Profile, length: float) -> int:
    """Return the index of the table whose radius is nearest to that at a place [px]."""
    last = len(profile.radius) - 1
    return int(min(max(np.rint(length * (last / profile.length)), 0.0), last))


@njit
def interpolate_column(
    table: Floats, climb: float, sense: float, offset: float, out: Floats
) -> None:
    """Interpolate the table at a climb and at pixels offset, offset + 1, ... from the centre."""
    row, column, stride, row_fraction, fraction = table_position(table, climb, sense, offset)
    for k in range(len(out)):
        out[k] = table_value(table, row, column + k * stride, row_fraction, fraction)


@njit
def interpolated(table: Floats, climb: Floats, offset: Floats) -> Floats:
    """Interpolate a table of profiles at offsets (n, m) [px] from the beam, for climbs (n,)."""
    n, m = offset.shape
    out = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            row, column, _, row_fraction, fraction = table_position(
                table, climb[i], 1.0, offset[i, j]
            )
            out[i, j] = table_value(table, row, column, row_fraction, fraction)
    return out


@njit(inline="always")
def table_position(table: Floats, climb: float, sense: float, offset: float) -> Any:
    """Locate a pixel at `offset` from the centre: row and column of the entry before it.

    Also return the number of columns to the next pixel and the fractions of a row and of a column
    from the entry to the pixel. A pixel is a whole number of columns: all pixels have the same.
    """
    row = climb * (table.shape[0] - 1)
    low = min(int(row), table.shape[0] - 2)
    column = sense * offset / STEP + table.shape[1] // 2
    first = int(np.floor(column))
    return low, first, int(sense / STEP), row - low, column - first


@njit(inline="always")
def table_value(
    table: Floats, row: int, column: int, row_fraction: float, fraction: float
) -> float:
    """Interpolate the table between an entry and the next of both directions; 0 outside."""
    if not 0 <= column < table.shape[1] - 1:
        return 0.0
    flatter = (1 - fraction) * table[row, column] + fraction * table[row, column + 1]
    steeper = (1 - fraction) * table[row + 1, column] + fraction * table[row + 1, column + 1]
    return float((1 - row_fraction) * flatter + row_fraction * steeper)


def _fine_grid(extent: float) -> Floats:
    half = 4 * int(np.ceil(extent / STEP))
    return np.arange(-half, half + 1, dtype=np.float64) * (STEP / 4)


@njit
def _tabulated(fine: Floats, blurred: Floats) -> Floats:
    """Tabulate a brightness across the beam, on a grid of step STEP / 4: values and slopes.

    The double integral of the brightness, differenced over the pixel's height and the beam's rise
    within its width, is its mean over the pixel: exact however narrow the section is.
    """
    step = fine[1] - fine[0]
    once, twice = np.zeros(len(fine)), np.zeros(len(fine))
    for k in range(1, len(fine)):
        once[k] = once[k - 1] + step * (blurred[k - 1] + blurred[k]) / 2
        twice[k] = twice[k - 1] + step * (once[k - 1] + once[k]) / 2
    t = fine[::4]
    out = np.empty((2, SLOPES, len(t)))
    for i in range(SLOPES):
        climb = i / (SLOPES - 1)
        # An oblique section is the same one, only wider.
        stretch = np.hypot(1.0, climb)
        for k in range(len(t)):
            above, below = (t[k] + 0.5) / stretch, (t[k] - 0.5) / stretch
            rise = climb / 2 / stretch
            if i == 0:
                out[0, i, k] = _at(once, fine, above) - _at(once, fine, below)
                out[1, i, k] = _at(blurred, fine, above) - _at(blurred, fine, below)
                continue
            out[0, i, k] = (stretch**2 / climb) * (
                (_at(twice, fine, above + rise) - _at(twice, fine, above - rise))
                - (_at(twice, fine, below + rise) - _at(twice, fine, below - rise))
            )
            out[1, i, k] = (stretch / climb) * (
                (_at(once, fine, above + rise) - _at(once, fine, above - rise))
                - (_at(once, fine, below + rise) - _at(once, fine, below - rise))
            )
    return out


@njit
def _at(values: Floats, fine: Floats, t: float) -> float:
    """Interpolate values on a grid that begins with 0s; they go on as a straight line after it."""
    place = (t - fine[0]) / (fine[1] - fine[0])
    if place < 0:
        return 0.0
    k = min(int(place), len(fine) - 2)
    return float(values[k] + (place - k) * (values[k + 1] - values[k]))


def _of_strips(section: Section, shade: Floats, length: float) -> Profile:
    """Tabulate the profiles of a section whose strips are as bright as their `shade`."""
    places = np.linspace(-0.5, 0.5, TAPERED_TABLES) if section.taper else np.zeros(1)
    radii = section.radius * (1 + section.taper * places)
    extent = 1.5 * radii.max() + 5 * section.spread * 1.5 + 1.5
    fine, shade = _fine_grid(extent), shade / shade.sum()
    across = [_blurred(fine, replace(section, radius=float(radius)), shade) for radius in radii]
    value, slope = np.stack([_tabulated(fine, one) for one in across], axis=1)
    return Profile(value, slope, np.array(across)[:, ::4], radii, length)


def _strips() -> Floats:
    """Compute the midpoints of strips of equal width across the section, over its radius."""
    edges = np.linspace(-1, 1, _STRIPS + 1)
    return np.asarray((edges[1:] + edges[:-1]) / 2)


def _blurred(t: Floats, section: Section, brightness: Floats) -> Floats:
    """Blur strips with this brightness across the section at t [px], evenly spaced about 0."""
    step = t[1] - t[0]
    light = np.concatenate([[0.0], np.cumsum(brightness)])
    edges = section.radius * np.linspace(-1, 1, _STRIPS + 1)
    cells = np.append(t - step / 2, t[-1] + step / 2)
    even = np.diff(np.interp(cells, edges, light)) / step
    # Both ends are dark: that the transform is periodic has no effect.
    size = next_fast_len(len(t), real=True)
    frequency = rfftfreq(size, step)
    gaussian = np.exp(-2 * (np.pi * section.spread * frequency) ** 2)
    return np.asarray(irfft(rfft(even, size) * gaussian, size)[: len(t)])


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
    middle = len(table.radius) // 2
    value, slope = table.value[middle, 0], table.slope[middle, 0]
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
