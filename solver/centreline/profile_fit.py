"""Profile fit: position of the beam's known profile in every pixel column.

A column (or a row, where the beam is steep) shows amplitude x profile(v - centre) + background
+ slope (v - middle). The four parameters are estimated by Gauss-Newton, weighted with the sensor's
noise (maximum likelihood); the centre's variance is that of the linearised fit.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from solver.centreline.columns import read_column, table_position, table_value
from solver.centreline.noise import ROUNDING, Noise
from solver.centreline.profile import Profile
from solver.centreline.stations import Stations
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import FAST, njit

MAX_STEPS = 5
TOLERANCE_PX = 1e-4
# A longer step is followed by new weights. Chosen: it changes a sharp edge's pixel by a twentieth.
REWEIGH_PX = 0.05
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
        profile.nearest(places.length),
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


@njit
def _fit(
    image: Grey,
    along: npt.NDArray[np.int64],
    start: Floats,
    climb: Floats,
    upright: npt.NDArray[np.bool_],
    sense: Floats,
    table: npt.NDArray[np.int64],
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
    gray, weight, expected = np.empty(size), np.empty(size), np.empty(size)
    for i in range(n):
        row[:] = 0.0
        row[1] = row[3] = np.inf
        first = int(np.rint(start[i])) - half
        if read_column(image, along[i], upright[i], first, gray):
            used, sums = _weigh(gray, gray, full_scale, dark, per_gray, half, weight)
            row[7] = size - used
            if used >= THRESHOLDS.min_pixels:
                _fit_column(
                    start[i], first, half, min(climb[i], 1.0), sense[i],
                    value[table[i]], slope[table[i]],
                    dark, per_gray, full_scale, gray, weight, expected, sums, row,
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
    gray: Floats,
    weight: Floats,
    expected: Floats,
    sums: Any,
    fields: Floats,
) -> None:
    """Run Gauss-Newton from `start` and write into `fields`, which is unchanged on failure.

    For a fixed centre, the model is linear in background and amplitude: eliminating the background
    (1, x), then the profile from the weighted sums of products solves their least squares. `sums`
    are those of `_weigh` with the gray values' own weights.
    """
    c = start
    for step in range(MAX_STEPS + 1):
        w0, w1, w2, g0, g1, gg = sums
        p0, p1, pp, d0, d1, dp, dd, gp, gd = _profile_sums(
            value, slope, climb, sense, first - c, half, gray, weight, expected
        )
        # Make x orthogonal to 1, then subtract each product's part that lies in both.
        mean, per_w0 = w1 / w0, 1 / w0
        per_w2 = 1 / (w2 - mean * w1)
        p1, d1, g1 = p1 - mean * p0, d1 - mean * d0, g1 - mean * g0
        pp = pp - p0 * p0 * per_w0 - p1 * p1 * per_w2
        if not pp > 0:
            return
        dp = dp - d0 * p0 * per_w0 - d1 * p1 * per_w2
        dd = dd - d0 * d0 * per_w0 - d1 * d1 * per_w2
        gp = gp - g0 * p0 * per_w0 - g1 * p1 * per_w2
        gd = gd - g0 * d0 * per_w0 - g1 * d1 * per_w2
        gg = gg - g0 * g0 * per_w0 - g1 * g1 * per_w2
        a, d_in_p = gp / pp, dp / pp
        # d(gray)/d(centre) = -sense a d.
        information = a * a * (dd - d_in_p * dp)
        if not information > 0:
            return
        s = (g1 - a * p1) * per_w2
        b = (g0 - a * p0) * per_w0 - mean * s
        if step == MAX_STEPS:
            break
        update = -sense * a * (gd - d_in_p * gp) / information
        c += min(max(update, -0.5), 0.5)
        if abs(c - start) > half - 2:
            return
        if step < 2 or abs(update) > REWEIGH_PX:
            # Weights from the model's gray values, not from the noisy ones, nor from those of a
            # model elsewhere: it would call dark pixels bright, and their noise larger than it is.
            for k in range(len(expected)):
                expected[k] = max(a * expected[k] + b + s * (k - half), 0.0)
            _, sums = _weigh(gray, expected, full_scale, dark, per_gray, half, weight)
        elif abs(update) < TOLERANCE_PX:
            break
    fields[0], fields[1], fields[2] = c, 1 / np.sqrt(information), a
    fields[3], fields[4], fields[5] = 1 / np.sqrt(pp), b, max(gg - a * gp, 0.0)


@njit(fastmath=FAST)
def _profile_sums(
    value: Floats,
    slope: Floats,
    climb: float,
    sense: float,
    offset: float,
    half: int,
    gray: Floats,
    weight: Floats,
    profile: Floats,
) -> Any:
    """Write the profile (n,) and sum its weighted products, and those of its derivative.

    The products of the profile are with 1, x and itself, those of its derivative with 1, x, the
    profile and itself, and those of the gray values with both.
    """
    row, column, stride, row_fraction, fraction = table_position(value, climb, sense, offset)
    p0 = p1 = pp = d0 = d1 = dp = dd = gp = gd = 0.0
    for k in range(gray.size):
        p = table_value(value, row, column, row_fraction, fraction)
        d = table_value(slope, row, column, row_fraction, fraction)
        column += stride
        profile[k] = p
        wp, wd, x = weight[k] * p, weight[k] * d, float(k - half)
        p0, p1, pp = p0 + wp, p1 + wp * x, pp + wp * p
        d0, d1, dp, dd = d0 + wd, d1 + wd * x, dp + wd * p, dd + wd * d
        gp, gd = gp + wp * gray[k], gd + wd * gray[k]
    return p0, p1, pp, d0, d1, dp, dd, gp, gd


@njit(fastmath=FAST)
def _weigh(
    gray: Floats,
    expected: Floats,
    full_scale: int,
    dark: float,
    per_gray: float,
    half: int,
    weight: Floats,
) -> Any:
    """Set weights by the noise of expected values, 0 at full scale; return how many are not 0.

    Also return the weighted sums of products of (1, x) with 1, x and the gray values, and of these.
    """
    used = 0
    w0 = w1 = w2 = g0 = g1 = gg = 0.0
    for k in range(gray.size):
        saturated = gray[k] >= full_scale
        used += not saturated
        w = 0.0 if saturated else 1.0 / max(dark + per_gray * expected[k], ROUNDING)
        weight[k] = w
        wg, x = w * gray[k], float(k - half)
        w0, w1, w2 = w0 + w, w1 + w * x, w2 + w * x * x
        g0, g1, gg = g0 + wg, g1 + wg * x, gg + wg * gray[k]
    return used, (w0, w1, w2, g0, g1, gg)
