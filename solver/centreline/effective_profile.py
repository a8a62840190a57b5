"""The beam's profile as the rest images show it, for a beam that no section of `profile` describes.

Polished steel has a bright line between dark flanks, and a sharpened image has flanks of the
opposite sign. All columns along the beam sample one profile at different places between the pixels:
it is a spline across the beam, fitted to all columns together with the beam's course (as Anderson
and King, 2000, do for stars).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from solver.centreline.noise import Noise
from solver.centreline.profile import Profile, interpolated, spline_profile
from solver.centreline.smooth import REST_DEGREE
from solver.centreline.stations import Stations
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey

# Distance [px] of the spline's knots, or this part of a wide profile. Chosen: at half a pixel, the
# highlight of a thin polished beam was not resolved.
KNOT_PX, KNOTS = 1 / 3, 20
# Largest change [px] of the centre in one round. Chosen: within the range of the derivative.
MAX_STEP_PX = 0.5
# A profile's edges are where it falls to this share of its largest value. Chosen: above the noise.
EDGE = 0.1
# Largest number of rounds in which profile and course are improved together. Chosen.
ROUNDS = 12
# A round that improves chi^2 by less than this fraction is the last one. Chosen.
CONVERGED = 1e-3
# Sigma of the spline's second differences, over its largest value. Chosen: details finer than a
# pixel, which its average removes, remain small.
ROUGHNESS = 0.3
# Largest number of columns that are read, evenly along the beam. Chosen: a megabyte for each knot.
MAX_COLUMNS = 1000
# Relative weight that keeps the normal equations regular. Chosen: far below that of the data.
RIDGE = 1e-6


class Columns(NamedTuple):
    """Pixels of n columns across the beam: `gray` (n, m) and its `variance`.

    `offset` (n, m) [px] is a pixel's distance from the path along the column, in the sense of the
    path's normal; `climb` (n,) is the column's, and `length` (n,) [px] its place along the path.
    """

    gray: Floats
    variance: Floats
    offset: Floats
    climb: Floats
    length: Floats


def read_columns(
    images: Sequence[Grey], places: Stations, half: int, noise: Noise, full_scale: int
) -> Columns:
    """Average images (height, width) in 2 half + 1 pixels of each column within the image.

    Columns with too few pixels below full scale are left out.
    """
    places = places.take(places.within(half, images[0].shape))
    places = places.take(slice(None, None, max(-(-places.size // MAX_COLUMNS), 1)))
    index = places.pixels(half)
    pixels = np.array([image[index] for image in images], np.float64)
    gray = pixels.mean(axis=0)
    variance = np.array(noise.variance(gray)) / len(pixels)
    variance[(pixels >= full_scale).any(axis=0)] = np.inf
    enough = np.isfinite(variance).sum(axis=1) >= THRESHOLDS.min_pixels
    places = places.take(enough)
    return Columns(
        gray[enough], variance[enough], places.offset(half), np.abs(places.climb), places.length
    )


class EffectiveProfile(NamedTuple):
    """The profile, and the distance (n,) [px] of the beam from the path, along its normal."""

    table: Profile
    off_path: Floats


def effective_profile(columns: Columns, reach: float, polarity: int) -> EffectiveProfile | None:
    """Fit a profile that extends `reach` [px] to both sides of the beam.

    Amplitudes have the sign of `polarity`. In each column, the background is a straight line.
    Return None for fewer columns than `min_stations`.
    """
    if len(columns.gray) < THRESHOLDS.min_stations:
        return None
    weight = 1 / np.sqrt(columns.variance)
    step = max(KNOT_PX, reach / KNOTS)
    knots = step * np.arange(-int(reach / step), int(reach / step) + 1)
    basis = course_basis(columns.length, columns.length)
    x = np.broadcast_to(np.linspace(-1, 1, columns.gray.shape[1]), columns.gray.shape)
    line = np.linalg.qr(np.stack([np.ones_like(x), x], axis=-1) * weight[..., None])[0]

    def beyond_line(values: Floats) -> Floats:
        """Remove the straight lines from values (n, m, k), in units of the noise."""
        weighted = values * weight[..., None]
        return np.asarray(weighted - line @ (line.transpose(0, 2, 1) @ weighted))

    gray = beyond_line(columns.gray[..., None])[..., 0]
    hat = spline_profile(np.ones(1), step, reach)
    stretch = np.hypot(1.0, columns.climb)[:, None]
    centre, amplitude = np.zeros(basis.shape[1]), np.eye(basis.shape[1])[0]
    good, least = np.ones(len(gray), bool), np.inf
    best = None

    def splines(offset: Floats) -> Floats:
        """Compute the columns of each knot, (n, m, k), without their lines."""
        shapes = [interpolated(hat.value[0], columns.climb, offset - k * stretch) for k in knots]
        return beyond_line(np.stack(shapes, -1) * (basis @ amplitude)[:, None, None])

    for _ in range(ROUNDS):
        offset = columns.offset - (basis @ centre)[:, None]
        design = splines(offset)
        values = _spline(design[good], gray[good], len(knots))
        residual = gray - design @ values
        misfit = (residual**2).mean(axis=1)
        good = misfit <= THRESHOLDS.max_misfit * np.median(misfit)
        chi2 = float(np.median(misfit))
        if best is not None and chi2 > (1 - CONVERGED) * least:
            break
        best, least = (values, centre, amplitude, good), chi2
        # Improve profile and course together: one in turn after the other would drift slowly.
        table = spline_profile(values, step, reach)
        slope = interpolated(table.slope[0], columns.climb, offset) * (basis @ amplitude)[:, None]
        value = interpolated(table.value[0], columns.climb, offset)
        by_course = beyond_line(np.stack([-slope, value], axis=-1))
        by_course = (by_course[..., None] * basis[:, None, None]).reshape(*gray.shape, -1)
        joint = np.concatenate([design, by_course], axis=-1)
        update = _spline(joint[good], gray[good], len(knots))[len(knots) :]
        terms = basis.shape[1]
        limit = max(1.0, float(np.abs(basis @ update[:terms]).max()) / MAX_STEP_PX)
        centre = centre + update[:terms] / limit
        amplitude = amplitude + update[terms:] / limit
        amplitude = amplitude / np.median(basis @ amplitude)
    assert best is not None
    values, centre, amplitude, good = best
    # The axis is in the middle of the beam's light and shade, not at its highlight: measured beside
    # the axis, a bent beam is a parallel curve.
    fine = np.linspace(knots[0], knots[-1], 1001)
    inside = fine[np.abs(np.interp(fine, knots, values)) > EDGE * np.abs(values).max()]
    centre = centre + np.eye(len(centre))[0] * (inside[0] + inside[-1]) / 2
    offset = columns.offset - (basis @ centre)[:, None]
    values = _spline(splines(offset)[good], gray[good], len(knots))
    area = polarity * float(np.abs(values).sum()) * step
    return EffectiveProfile(spline_profile(values / area, step, reach), basis @ centre)


def _spline(design: Floats, gray: Floats, n_knots: int) -> Floats:
    """Fit parameters (k,) to columns (n, m) of a design (n, m, k): a spline's values, then others.

    The scale of the prior is that of a first fit's largest value.
    """
    flat = design.reshape(-1, design.shape[-1])
    normal, right = flat.T @ flat, flat.T @ gray.ravel()
    # Changes of the course that the spline imitates, a shift and a scale, remain small. The spline
    # is in gray values, the course in pixels: with one scale for both, the result would depend on
    # the images' depth.
    parts = np.split(np.diag(normal), [n_knots])
    ridge = np.concatenate([part + part.sum() / max(len(part), 1) for part in parts])
    normal += RIDGE * np.diag(ridge)
    largest = float(np.abs(np.linalg.solve(normal, right)[:n_knots]).max())
    second = np.diff(np.eye(n_knots + 2), 2, axis=0)[:, 1:-1] / (ROUGHNESS * largest)
    normal[:n_knots, :n_knots] += second.T @ second
    return np.asarray(np.linalg.solve(normal, right))


def course_basis(length: Floats, used: Floats) -> Floats:
    """Evaluate the polynomials (n, REST_DEGREE + 1) of a smooth course at lengths (n,) of a path.

    They are orthogonal over the range of the lengths that are `used`, and constant beyond it.
    """
    unit = np.clip(2 * (length - used[0]) / max(float(np.ptp(used)), 1.0) - 1, -1, 1)
    return np.polynomial.chebyshev.chebvander(unit, int(REST_DEGREE))
