"""Edges of a flat strip of which the camera sees two faces, in every pixel column.

The faces are unequally bright, and the ratio changes as the strip turns. Its near edge also moves
against the far one, as the camera sees the strip from another side: a profile of fixed shape would
follow the brighter edge. A column is therefore fitted by both edges, by the brightness of each face
between them, and by a straight background; the centre is the middle of the edges.

Where the thickness is at an angle a to the image, the narrow face looks t cos(a) wide and the wide
one b sin(a). As the angle changes,

    d(narrow) / d(wide) = -(narrow / wide) tan(a)^2,

so that the width of both together determines the place of the ridge between them.
"""

import itertools
import math
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import minimize

from solver.centreline.blurred_edge import blurred_edge
from solver.centreline.effective_profile import EDGE
from solver.centreline.noise import Noise, pixel_variance
from solver.centreline.profile import STEP, Profile
from solver.centreline.profile_fit import Fits
from solver.centreline.rest_columns import RestColumns, Shape
from solver.centreline.stations import Stations, read_column
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import FAST, njit
from solver.instrument.errors import InputError
from solver.instrument.small_matrices import dot, solve

# Narrowest strip [px]. Chosen: below it, the narrower face is no pixel wide.
MIN_WIDTH_PX: Final = 4.0
# Ridges that are tried first, over the width from its middle, and the part of a width within which
# a ridge is one: beyond, it is an edge. Chosen.
RIDGES: Final = (-0.35, -0.15, 0.15, 0.35)
MAX_RIDGE: Final = 0.45
# The blur's standard deviation [px], beside the pixel's own: those that are tried first, and the
# range. Chosen: a sharp image and a usual one; and what is as good as sharp, or out of focus.
SPREADS: Final = (0.1, 0.5)
MIN_SPREAD, MAX_SPREAD = 0.02, 3.0
# First steps of ridge and blur in the search. Chosen: a third of the distance between the trials.
STEPS: Final = (0.07, 0.1)
# At rest, every such column is used to find the ridge. Chosen: 100 columns determine it to a
# hundredth of a pixel. Trials are more than a search needs. Measured: four end after 52 to 66.
_STRIDE: Final = 4
_TRIALS: Final = 200
_MAX_STEPS: Final = 8
# Longest step, and one that is the last. Chosen: half a pixel is within the range of a sharp edge's
# derivative, and the error after the last step is about the square of its length.
MAX_STEP_PX, TOLERANCE_PX = 0.5, 1e-3
_PARAMETERS: Final = 6


class Strip(NamedTuple):
    """A flat strip: its `thickness` [px], and the angle `tilt` [rad] of that to the image."""

    thickness: float
    tilt: float


class Faces(NamedTuple):
    """Two faces of a strip at rest: its `width` [px], and the `spread` [px] of the blur.

    The line between them is `ridge` [px] from the strip's middle along the path's normal, and moves
    by `ridge_by_width` where the strip looks wider. `levels` (2,) [gray] are first values of the
    faces' brightness over the background's.
    """

    width: float
    ridge: float
    ridge_by_width: float
    spread: float
    levels: Floats


class FaceFits(NamedTuple):
    """Fits at n stations, and the strip's `width` (n,) [px] across its direction."""

    fits: Fits
    width: Floats


class StripAtRest(NamedTuple):
    """The faces of a strip, and the fits to its rest images."""

    faces: Faces
    shape: Shape


def learn_faces(rest: RestColumns, one: Shape, strip: Strip) -> StripAtRest | None:
    """Learn the two faces of a flat strip that the rest images show as the shape `one`.

    Return None for a strip that is too narrow, or which one profile describes better.
    """
    width = _extent(one.table) - 2 * SPREADS[1]
    if width < MIN_WIDTH_PX:
        return None
    places = rest.places.take(one.good)
    start = places.start + places.sense * one.centre[one.good]
    contrast = float(np.median([np.median(fit.amplitude[one.good]) for fit in one.fits])) / width
    few = places._replace(start=start).take(slice(None, None, _STRIDE))
    half = rest.half_width(one.section)

    def fit(p: Floats) -> FaceFits:
        """Fit faces that have this ridge, over the width, and this blur."""
        faces = Faces(width, p[0] * width, p[0], p[1], np.full(2, contrast))
        return fit_faces(rest.images[0], few, faces, rest.noise, half, rest.full_scale)

    def misfit(p: Floats) -> float:
        """Return the median misfit."""
        if not (abs(p[0]) < MAX_RIDGE and MIN_SPREAD < p[1] < MAX_SPREAD):
            return math.inf
        fits = fit(p).fits
        found = fits.dof > 0
        return float(np.median(fits.chi2[found] / fits.dof[found])) if found.any() else math.inf

    best = min((np.array(p) for p in itertools.product(RIDGES, SPREADS)), key=misfit)
    corners = best + np.vstack([np.zeros(2), np.diag(STEPS)])
    options = {"initial_simplex": corners, "maxfev": _TRIALS, "xatol": 1e-3, "fatol": 1e-3}
    p = minimize(misfit, best, method="Nelder-Mead", options=options).x
    best_fit = fit(p)
    found = best_fit.fits.dof > 0
    if not found.any():
        return None
    width = float(np.median(best_fit.width[found]))
    ridge, by_width = _ridge(float(p[0]), width, strip)
    faces = Faces(width, ridge, by_width, float(p[1]), np.full(2, contrast))
    shape = _shape(rest, one, faces, half)
    if shape is None or shape.misfit > max(one.misfit, THRESHOLDS.max_section_misfit):
        return None
    return StripAtRest(faces, shape)


class _Ridge(NamedTuple):
    """Place [px] of a ridge along the path's normal, and its change by the strip's width."""

    place: float
    by_width: float


def _ridge(relative: float, width: float, strip: Strip) -> _Ridge:
    """Place the ridge of a strip, which is at rest at a `relative` place over its width [px]."""
    before, after = (0.5 + relative) * width, (0.5 - relative) * width
    expected = strip.thickness * math.cos(strip.tilt)
    is_after = abs(after - expected) < abs(before - expected)
    narrow, wide = (after, before) if is_after else (before, after)
    narrow_by_wide = -(narrow / wide) * math.tan(strip.tilt) ** 2
    by_width = 0.5 - narrow_by_wide / (1 + narrow_by_wide)
    return _Ridge(relative * width, by_width if is_after else -by_width)


def _extent(table: Profile) -> float:
    """Return the extent [px] of a profile where it is above EDGE of its largest value."""
    values = np.abs(table.value[len(table.radius) // 2, 0])
    return STEP * float(np.ptp(np.flatnonzero(values > EDGE * values.max())))


def _shape(rest: RestColumns, one: Shape, faces: Faces, half: int) -> Shape | None:
    """Measure what two faces leave of the rest images; None where they show too few columns."""
    start = rest.places.start + rest.places.sense * one.centre
    places = rest.places._replace(start=start)
    fits = [
        fit_faces(image, places, faces, rest.noise, half, rest.full_scale).fits
        for image in rest.images
    ]
    try:
        return rest.shape_of_fits(one.section, one.table, fits)
    except InputError:
        return None


@njit
def fit_faces(
    image: Grey, places: Stations, faces: Faces, noise: Noise, half: int, full_scale: int
) -> FaceFits:
    """Fit edges and faces at every station, from its start, on `half` pixels on either side.

    Pixels of `full_scale` or more are left out. The amplitude [gray px] is that of both faces.
    """
    n, size = len(places.along), 2 * half + 1
    out, gray = np.zeros((9, n)), np.empty(size)
    columns = np.empty((_PARAMETERS, size))
    for i in range(n):
        out[1, i] = out[3, i] = np.inf
        first = int(np.rint(places.start[i])) - half
        if read_column(image, places.along[i], places.upright[i], first, gray):
            _fit_column(
                places.start[i], first, abs(places.climb[i]), places.sense[i],
                faces, noise, full_scale, gray, columns, out[:, i],
            )  # fmt: skip
    fits = Fits(
        out[0], out[1], out[2], out[3], out[4], out[5],
        out[6].astype(np.int64), out[7].astype(np.int64),
    )  # fmt: skip
    return FaceFits(fits, out[8])


@njit
def _fit_column(
    start: float,
    first: int,
    climb: float,
    sense: float,
    faces: Faces,
    noise: Noise,
    full_scale: int,
    gray: Floats,
    columns: Floats,
    fields: Floats,
) -> None:
    """Run Gauss-Newton from `start`, and write the fields of `FaceFits`; on failure, counts only.

    The parameters are centre, width, both faces' brightness, background and its slope.
    """
    stretch = math.hypot(1.0, climb)
    # A column averages the beam's rise within its width.
    blur = math.sqrt((faces.spread * stretch) ** 2 + climb * climb / 12)
    used = np.count_nonzero(gray < full_scale)
    fields[7] = gray.size - used
    if used < _PARAMETERS + 2:
        return
    p = np.array(
        [start, faces.width, faces.levels[0], faces.levels[1], min(gray[0], gray[-1]), 0.0]
    )
    normal, right = np.empty((_PARAMETERS, _PARAMETERS)), np.empty(_PARAMETERS)
    for step in range(_MAX_STEPS + 1):
        _derivatives(p, first, sense, stretch, blur, faces, columns)
        chi2 = _normal_equations(p, gray, columns, noise, full_scale, normal, right)
        if step == _MAX_STEPS:
            break
        if not solve(normal.copy(), right):
            return
        # The first step finds the levels only.
        limit = MAX_STEP_PX if step > 0 else 0.0
        moved = max(abs(right[0]), abs(right[1]))
        for j in range(2):
            right[j] = min(max(right[j], -limit), limit)
        p += right
        if abs(p[0] - start) > gray.size // 2 - 2 or not p[1] > 0.5 * faces.width:
            return
        if step > 0 and moved < TOLERANCE_PX:
            break
    by_light, ridge = np.zeros(_PARAMETERS), _ridge_at(p[1], faces)
    by_light[2], by_light[3] = p[1] / 2 + ridge, p[1] / 2 - ridge
    variance, light = np.zeros(_PARAMETERS), by_light.copy()
    variance[0] = 1.0
    fields[2], fields[4] = dot(by_light, p), p[4]
    if (
        solve(normal.copy(), variance)
        and solve(normal, light)
        and min(variance[0], dot(by_light, light)) > 0
    ):
        fields[0], fields[1] = p[0], math.sqrt(variance[0])
        fields[3] = math.sqrt(dot(by_light, light))
        fields[5], fields[6], fields[8] = chi2, used - _PARAMETERS, p[1]


@njit(fastmath=FAST)
def _normal_equations(
    p: Floats,
    gray: Floats,
    columns: Floats,
    noise: Noise,
    full_scale: int,
    normal: Floats,
    right: Floats,
) -> float:
    """Write the normal equations (6, 6) and (6,) of parameters p (6,); return their chi^2."""
    normal[:], right[:], chi2 = 0.0, 0.0, 0.0
    for k in range(gray.size):
        if gray[k] >= full_scale:
            continue
        expected = 0.0
        for j in range(2, _PARAMETERS):
            expected += p[j] * columns[j, k]
        weight = 1 / pixel_variance(noise, max(expected, 0.0))
        residual = gray[k] - expected
        chi2 += weight * residual * residual
        for j in range(_PARAMETERS):
            weighted = weight * columns[j, k]
            right[j] += residual * weighted
            for m in range(j + 1):
                normal[j, m] += weighted * columns[m, k]
    for j in range(_PARAMETERS):
        for m in range(j):
            normal[m, j] = normal[j, m]
    return chi2


@njit(inline="always")
def _ridge_at(width: float, faces: Faces) -> float:
    """Place the ridge [px] of a strip that looks so wide [px]."""
    return faces.ridge + faces.ridge_by_width * (width - faces.width)


@njit
def _derivatives(
    p: Floats,
    first: int,
    sense: float,
    stretch: float,
    blur: float,
    faces: Faces,
    columns: Floats,
) -> None:
    """Write the derivatives (6, n) of the gray values by the parameters p (6,)."""
    edge, middle = stretch * p[1] / 2, (columns.shape[1] - 1) / 2
    ridge, by_width = stretch * _ridge_at(p[1], faces), faces.ridge_by_width
    for k in range(columns.shape[1]):
        t = first + k - p[0]
        low, at_low = blurred_edge(t + sense * edge, blur)
        inner, at_inner = blurred_edge(t - sense * ridge, blur)
        high, at_high = blurred_edge(t - sense * edge, blur)
        columns[0, k] = -sense * (p[2] * (at_low - at_inner) + p[3] * (at_inner - at_high))
        columns[1, k] = stretch * (
            p[2] * (at_low / 2 + by_width * at_inner) - p[3] * (by_width * at_inner - at_high / 2)
        )
        columns[2, k], columns[3, k] = sense * (low - inner), sense * (inner - high)
        columns[4, k], columns[5, k] = 1.0, k - middle
