"""Every long thin line in a photograph, without a rig: found, followed, and measured.

Candidates of columns and rows -> chains -> path -> profile fit. Whether the lines are bright or
dark, how wide they are and how noisy the image is, is read off the image itself.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import minimize

from solver.centreline import Centreline, Flag
from solver.centreline.chains import long_lines
from solver.centreline.noise import Noise, noise_of
from solver.centreline.profile import Section, profile
from solver.centreline.profile_fit import MARGIN, Fits, fit_profiles
from solver.centreline.smooth import smooth_curve
from solver.centreline.stations import Stations, stations
from solver.instrument.arrays import Floats, Grey, Mask

# Widths [px] that are tried.
CORES = (2, 3, 5, 8)
# A line is long if it spans this share of the image's shorter side.
LONG = 0.25
# Beyond its ends a line is sought so far [px], and goes on to where so many stations miss it.
BEYOND_PX, MISSED = 40.0, 4
# Amplitudes below this share of the usual one, or of fewer sigmas, do not show the line.
DIMMEST, LEAST_SIGNIFICANCE = 0.3, 5.0
# A centre that is known no better does not show it either [px].
WORST_SIGMA_PX = 0.3
WORST_MISFIT = 4.0
FARTHEST_SIGMAS, FARTHEST_PX = 6.0, 0.3
NEIGHBOURHOOD, ALONE, LAST = 61, 9, 3


@dataclass(frozen=True)
class Line:
    """A line: its points, whether it is brighter (1) or darker (-1) than its ground, its section.

    `roughness` [px] is the root mean square of the points about a smooth curve: noise, the
    photograph's fixed pattern, and what the line itself has of it.
    """

    centreline: Centreline
    polarity: int
    section: Section
    roughness: float


def trace(image: Grey) -> list[Line]:
    """The long thin lines of an image (height, width), the longest first."""
    noise = noise_of([image])
    least = LONG * min(image.shape)
    tried = (
        (long_lines(image, core, polarity, noise, least), core, polarity)
        for polarity in (-1, 1)
        for core in CORES
    )
    # The width and the polarity under which most is seen.
    chains, core, polarity = max(tried, key=lambda one: sum(len(chain) for chain in one[0]))
    found = (_measured(image, chain, core, polarity, noise) for chain in chains)
    lines = [line for line in found if line is not None and _extent(line) >= least]
    return sorted(lines, key=lambda line: -len(line.centreline.points))


def _extent(line: Line) -> float:
    points = line.centreline.points
    return float(np.hypot(*(points[-1] - points[0])))


def _measured(image: Grey, chain: Floats, core: int, polarity: int, noise: Noise) -> Line | None:
    """Profile fits along a chain, and beyond its ends as far as the line is seen."""
    path = _path(chain)
    if path is None:
        return None
    places = stations(path, image.shape)
    section = _section(image, places, noise, core / 2)
    fits = _fits(image, places, section, noise)
    misfit = fits.chi2 / np.maximum(fits.dof, 1)
    amplitude = fits.amplitude * polarity
    known = np.isfinite(fits.sigma) & (amplitude > LEAST_SIGNIFICANCE * fits.amplitude_sigma)
    if np.count_nonzero(known) < NEIGHBOURHOOD // 2:
        return None
    # A line that tapers, or has a rough ground, leaves more all along: what is foreign differs from
    # the columns about it.
    usual = np.maximum(_running_median(misfit, known), 1.0)
    flags = np.zeros(len(places), np.uint8)
    flags[misfit > WORST_MISFIT * usual] = Flag.FOREIGN
    flags[~known | (amplitude < DIMMEST * _running_median(amplitude, known))] = Flag.HIDDEN
    sigma = fits.sigma * np.sqrt(np.maximum(misfit, usual))
    flags[sigma > WORST_SIGMA_PX] = Flag.HIDDEN
    off_path = places.sense * (fits.centre - places.start)
    smooth = smooth_curve(places.length, off_path, np.where(flags == 0, sigma, np.inf))
    if smooth is None:
        return None
    off = np.abs(off_path - smooth)
    flags[(flags == 0) & (off > FARTHEST_PX) & (off > FARTHEST_SIGMAS * sigma)] = Flag.FOREIGN
    # A place that is good by itself, among such as are not, is so by chance.
    flags[(flags == 0) & ~median_filter(flags == 0, ALONE)] = Flag.FOREIGN
    seen = _seen(flags == 0, places, path)
    good = seen & (flags == 0)
    if np.count_nonzero(good) < NEIGHBOURHOOD // 2:
        return None
    between = seen & (flags > 0)
    centreline = Centreline(
        points=places.pixels(fits.centre)[good],
        directions=places.directions[good],
        sigma=sigma[good],
        rejected=places.pixels(places.start + places.sense * smooth)[between],
        flags=flags[between],
    )
    roughness = float(np.sqrt(np.mean(off[good] ** 2)))
    return Line(centreline, polarity, section, roughness)


def _path(chain: Floats) -> Floats | None:
    """A smooth curve through a chain (n, 2), a point a pixel, straight on beyond both ends."""
    step = np.hypot(*np.diff(chain, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(step)])
    along = np.linspace(0, s[-1], max(2, round(s[-1])))
    error = np.full(len(s), 0.3)
    u, v = (smooth_curve(s, chain[:, i], error, along) for i in (0, 1))
    if u is None or v is None:
        return None
    line = np.column_stack([u, v])
    beyond = np.arange(1.0, BEYOND_PX)[:, None]
    pieces = [line]
    for end, inner in ((0, 10), (-1, -11)):
        towards = line[end] - line[inner]
        straight = line[end] + beyond * towards / np.hypot(*towards)
        pieces = [straight[::-1], *pieces] if end == 0 else [*pieces, straight]
    return np.vstack(pieces)


def _half(section: Section) -> int:
    return int(np.ceil(section.radius + 2.5 * section.spread + 0.5)) + 1 + MARGIN


def _fits(image: Grey, places: Stations, section: Section, noise: Noise) -> Fits:
    # A photograph's blackest and brightest are not a sensor's full scale.
    full_scale = int(np.iinfo(image.dtype).max)
    return fit_profiles(image, places, profile(section), noise, _half(section), full_scale)


def _section(image: Grey, places: Stations, noise: Noise, radius: float) -> Section:
    """The even band, smeared, that leaves least in all columns."""

    def cost(p: Floats) -> float:
        if not (0.2 < p[0] < 4 * radius + 1 and 0.2 < p[1] < 4):
            return 1e12
        fits = _fits(image, places, Section(p[0], p[1], 0.0, 0.0), noise)
        known = np.isfinite(fits.sigma)
        return float(np.log1p(fits.chi2[known] / fits.dof[known] / 9).mean())

    start = np.array([radius, 0.5])
    simplex = start + np.array([[0, 0], [0.3 * radius, 0], [0, 0.3]])
    found = minimize(
        cost,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": 40, "xatol": 0.02, "fatol": 1e-4},
    )
    return Section(float(found.x[0]), float(found.x[1]), 0.0, 0.0)


def _seen(good: Mask, places: Stations, path: Floats) -> Mask:
    """The stations (n,) along the chain, and beyond its ends up to where some running are no good.

    Outer ones that are no good themselves are left off, and those at the line's own end.
    """
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    inside = (places.length > BEYOND_PX) & (places.length < length - BEYOND_PX)
    first, last = (int(i) for i in np.flatnonzero(inside)[[0, -1]])
    while first > 0 and good[max(0, first - MISSED) : first].any():
        first -= 1
    while last < len(good) - 1 and good[last + 1 : last + 1 + MISSED].any():
        last += 1
    held = np.flatnonzero(good[first : last + 1]) + first
    seen = np.zeros(len(good), np.bool_)
    if len(held):
        # A line that ends in the image does not fill its last columns.
        start = held[0] + (LAST if held[0] > 0 else 0)
        stop = held[-1] + 1 - (LAST if held[-1] < len(good) - 1 else 0)
        seen[start:stop] = True
    return seen


def _running_median(values: Floats, known: Mask) -> Floats:
    """The median (n,) of the known among the neighbours of every place."""
    at = np.arange(len(values))
    filled = np.interp(at, at[known], values[known])
    return np.asarray(median_filter(filled, NEIGHBOURHOOD, mode="nearest"))
