"""Profile fit: position of the beam's known profile in every pixel column.

A column (or a row, where the beam is steep) shows amplitude x profile(v - centre) + background
+ slope (v - middle). The four parameters are estimated by Gauss-Newton, weighted with the sensor's
noise (maximum likelihood); the centre's variance is that of the linearised fit.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from solver.centreline.columns import interpolate_profile, read_column
from solver.centreline.noise import ROUNDING, Noise
from solver.centreline.profile import Profile
from solver.centreline.stations import Stations
from solver.centreline.thresholds import LIMITS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit
from solver.instrument.dot_products import FAST

MAX_STEPS = 5
TOLERANCE_PX = 1e-4
# Pixels on either side, beyond the profile's extent, that determine the background.
MARGIN = 2


@dataclass(frozen=True)
class Fits:
    """Profile fits at n stations; a station that could not be fitted has sigma = inf.

    `centre`, its `sigma` [px], `amplitude` and its sigma [gray px], `background` [gray], `chi2` on
    `dof` degrees of freedom, `saturated`: number of pixels excluded because they are at full scale.
    """

    centre: Floats
    sigma: Floats
    amplitude: Floats
    amplitude_sigma: Floats
    background: Floats
    chi2: Floats
    dof: npt.NDArray[np.int64]
    saturated: npt.NDArray[np.int64]


def fit_profiles(
    image: Grey, places: Stations, profile: Profile, noise: Noise, half: int, full_scale: int
) -> Fits:
    """Fit the profile at every station, from its start.

    `half` pixels on either side are fitted; pixels of `full_scale` or more are left out.
    """
    fields = _fit(
        image,
        places.along,
        places.start,
        np.abs(places.climb),
        places.upright,
        places.sense,
        profile.value,
        profile.slope,
        noise.dark,
        noise.per_gray,
        half,
        full_scale,
    )
    return Fits(
        centre=fields[0],
        sigma=fields[1],
        amplitude=fields[2],
        amplitude_sigma=fields[3],
        background=fields[4],
        chi2=fields[5],
        dof=fields[6].astype(np.int64),
        saturated=fields[7].astype(np.int64),
    )


# Rows of a pixel column's linear model: the background (1, x), the profile, its derivative by the
# centre, and the gray values themselves. Numpy scalars are compiled once, literals anew.
GROUND, TILT, SHAPE, MOVE, GRAY = np.arange(5)


@njit
def _fit(
    image: Grey,
    along: npt.NDArray[np.int64],
    start: Floats,
    climb: Floats,
    upright: npt.NDArray[np.bool_],
    sense: Floats,
    value: Floats,
    slope: Floats,
    dark: float,
    per_gray: float,
    half: int,
    full_scale: int,
) -> Floats:
    """Fit all stations; return the fields of `Fits` (8, n)."""
    n, size = len(along), 2 * half + 1
    out, row = np.zeros((8, n)), np.empty(8)
    rows, weight, gram = np.empty((5, size)), np.empty(size), np.empty((5, 5))
    for i in range(n):
        row[:] = 0.0
        row[1] = row[3] = np.inf
        first = int(np.rint(start[i])) - half
        if read_column(image, along[i], upright[i], first, rows[GRAY]):
            used = _weigh(rows[GRAY], rows[GRAY], full_scale, dark, per_gray, weight)
            row[7] = size - used
            if used >= LIMITS.min_pixels:
                _fit_column(
                    start[i], first, half, min(climb[i], 1.0), sense[i], value, slope,
                    dark, per_gray, full_scale, rows, weight, gram, row,
                )  # fmt: skip
                row[6] = used - 4
        for field in range(len(row)):
            out[field, i] = row[field]
    return out


@njit
def _fit_column(
    start: float,
    first: int,
    half: int,
    climb: float,
    sense: float,
    value: Floats,
    slope: Floats,
    dark: float,
    per_gray: float,
    full_scale: int,
    rows: Floats,
    weight: Floats,
    gram: Floats,
    fields: Floats,
) -> None:
    """Run Gauss-Newton from `start` and write into `fields`, which is unchanged on failure.

    For a fixed centre, the model is linear in background and amplitude: eliminating rows of the
    Gram matrix (`_eliminate`) one after another solves their least squares.
    """
    c = start
    for step in range(MAX_STEPS + 1):
        interpolate_profile(value, climb, sense, first - c, rows[SHAPE])
        interpolate_profile(slope, climb, sense, first - c, rows[MOVE])
        _gram(weight, rows, half, gram)
        w0, w1, w2 = gram[GROUND, GROUND], gram[TILT, GROUND], gram[TILT, TILT]
        v0, v1 = gram[GRAY, GROUND], gram[GRAY, TILT]
        p0, p1 = gram[SHAPE, GROUND], gram[SHAPE, TILT]
        _eliminate(gram, GROUND)
        _eliminate(gram, TILT)
        pivot = gram[SHAPE, SHAPE]
        if not pivot > 0:
            return
        a = gram[GRAY, SHAPE] / pivot
        _eliminate(gram, SHAPE)
        # d(gray)/d(centre) = -sense a d.
        information = a * a * gram[MOVE, MOVE]
        if not information > 0:
            return
        v0, v1, det = v0 - a * p0, v1 - a * p1, w0 * w2 - w1 * w1
        b, s = (w2 * v0 - w1 * v1) / det, (w0 * v1 - w1 * v0) / det
        if step == MAX_STEPS:
            break
        update = -sense * a * gram[GRAY, MOVE] / information
        c += min(max(update, -0.5), 0.5)
        if abs(c - start) > half - 2:
            return
        if step < 2:
            # Weights from the model's gray values, not from the noisy ones.
            expected = rows[SHAPE]
            for k in range(len(expected)):
                expected[k] = max(a * expected[k] + b + s * (k - half), 0.0)
            _weigh(rows[GRAY], expected, full_scale, dark, per_gray, weight)
        elif abs(update) < TOLERANCE_PX:
            break
    fields[0], fields[1], fields[2] = c, 1 / np.sqrt(information), a
    fields[3], fields[4], fields[5] = 1 / np.sqrt(pivot), b, max(gram[GRAY, GRAY], 0.0)


@njit(fastmath=FAST)
def _gram(weight: Floats, rows: Floats, half: int, gram: Floats) -> None:
    """Compute the weighted Gram matrix (5, 5) of (1, x, profile, derivative, gray)."""
    p, d, g = rows[SHAPE], rows[MOVE], rows[GRAY]
    w0 = w1 = w2 = p0 = p1 = pp = d0 = d1 = dp = dd = 0.0
    g0 = g1 = gp = gd = gg = 0.0
    for k in range(weight.size):
        w, x = weight[k], float(k - half)
        wx, wp, wd, wg = w * x, w * p[k], w * d[k], w * g[k]
        w0, w1, w2 = w0 + w, w1 + wx, w2 + wx * x
        p0, p1, pp = p0 + wp, p1 + wp * x, pp + wp * p[k]
        d0, d1, dp, dd = d0 + wd, d1 + wd * x, dp + wd * p[k], dd + wd * d[k]
        g0, g1, gp, gd, gg = g0 + wg, g1 + wg * x, gp + wg * p[k], gd + wg * d[k], gg + wg * g[k]
    gram[GROUND, GROUND], gram[TILT, GROUND], gram[TILT, TILT] = w0, w1, w2
    gram[SHAPE, GROUND], gram[SHAPE, TILT], gram[SHAPE, SHAPE] = p0, p1, pp
    gram[MOVE, GROUND], gram[MOVE, TILT], gram[MOVE, SHAPE], gram[MOVE, MOVE] = d0, d1, dp, dd
    gram[GRAY, GROUND], gram[GRAY, TILT], gram[GRAY, SHAPE] = g0, g1, gp
    gram[GRAY, MOVE], gram[GRAY, GRAY] = gd, gg


@njit
def _eliminate(gram: Floats, row: np.int64) -> None:
    """Eliminate the `row` from all later rows of the Gram matrix (lower triangle)."""
    for a in range(row + 1, 5):
        factor = gram[a, row] / gram[row, row]
        for b in range(row + 1, a + 1):
            gram[a, b] -= factor * gram[b, row]


@njit
def _weigh(
    gray: Floats, expected: Floats, full_scale: int, dark: float, per_gray: float, weight: Floats
) -> int:
    """Set weights by the noise of expected values, 0 at full scale; return how many are not 0."""
    used = 0
    for k in range(len(gray)):
        saturated = gray[k] >= full_scale
        used += not saturated
        weight[k] = 0.0 if saturated else 1.0 / max(dark + per_gray * expected[k], ROUNDING)
    return used
