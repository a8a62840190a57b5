"""Profile fit: position of the beam's known profile in every pixel column.

A column (or a row, where the beam is steep) shows amplitude x profile(v - centre) + background
+ slope (v - middle). The four parameters are estimated by Gauss-Newton, weighted with the sensor's
noise (maximum likelihood); the centre's variance is that of the linearised fit.

Before a ground that is known from the rest images, the straight line is the light on it: the ground
is seen, dimmed or brightened, where the beam does not cover it. Under the beam, the ground's
typical level takes its place, so that the beam's amplitude is the contrast with that level
everywhere. The noise is that of the image and of the ground.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.centreline.ground import Ground
from solver.centreline.noise import ROUNDING, Noise, pixel_variance
from solver.centreline.profile import (
    Profile,
    interpolate_column,
    nearest_table,
    table_position,
    table_value,
)
from solver.centreline.stations import Stations, read_column
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey, copy_into
from solver.instrument.compiled import njit
from solver.instrument.dot_products import FAST
from solver.instrument.small_matrices import solve_definite

MAX_STEPS = 5
TOLERANCE_PX = 1e-4
# A longer step is followed by new weights. Chosen: it changes a sharp edge's pixel by a twentieth.
REWEIGH_PX = 0.05
# Pixels on either side, beyond the profile's extent, that determine the background.
MARGIN = 2
# Relative sigma of the amplitude since rest, before a known ground. Chosen: light and shade change
# it by less, and where the image determines it better, this has no weight.
AMPLITUDE_SIGMA = 0.2


class Fits(NamedTuple):
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


class KnownGround(NamedTuple):
    """The `ground` at rest, and the beam's `amplitude` (n,) [gray px] before it at n stations.

    The amplitudes of the image may differ by AMPLITUDE_SIGMA: where the ground is not known, it
    looks like a part of the beam.
    """

    ground: Ground
    amplitude: Floats


def fit_profiles(
    image: Grey,
    places: Stations,
    profile: Profile,
    noise: Noise,
    half: int,
    full_scale: int,
    known: KnownGround | None = None,
) -> Fits:
    """Fit the profile at every station, from its start, before a known ground if there is one.

    `half` pixels on either side are fitted; pixels of `full_scale` or more are left out.

    Where an object or its shadow hides the ground, the known ground explains a column worse than
    a straight line does: the better of both fits is kept.
    """
    plain: Fits = _fit(image, places, profile, noise, half, full_scale, None)
    if known is None:
        return plain
    before: Fits = _fit(image, places, profile, noise, half, full_scale, known)
    unlikely = before.chi2 > THRESHOLDS.max_misfit * np.maximum(before.dof, 1)
    keep = np.isfinite(before.sigma) & ~(unlikely & (plain.chi2 < before.chi2))
    return Fits(*(np.where(keep, *both) for both in zip(before, plain, strict=True)))


@njit
def _fit(
    image: Grey,
    places: Stations,
    profile: Profile,
    noise: Noise,
    half: int,
    full_scale: int,
    known: KnownGround | None,
) -> Fits:
    """Fit all stations, all before the known ground or none: both are compiled on their own."""
    n, size = len(places.along), 2 * half + 1
    out, row = np.zeros((8, n)), np.empty(8)
    gray, weight, expected = np.empty(size), np.empty(size), np.empty(size)
    pattern, variance, memory = np.empty(size), np.empty(size), np.empty((8, size))
    for i in range(n):
        row[:] = 0.0
        row[1] = row[3] = np.inf
        line, upright, start = places.along[i], places.upright[i], places.start[i]
        first = int(np.rint(start)) - half
        if read_column(image, line, upright, first, gray):
            table = nearest_table(profile, places.length[i])
            climb, sense = abs(places.climb[i]), places.sense[i]
            value, slope = profile.value[table], profile.slope[table]
            used, sums = _weigh(gray, gray, full_scale, noise, half, weight)
            row[7] = size - used
            if used >= THRESHOLDS.min_pixels:
                if known is None:
                    _fit_column(
                        start, first, half, climb, sense, value, slope,
                        noise, full_scale, gray, weight, expected, sums, row,
                    )  # fmt: skip
                else:
                    ground = known.ground
                    for k in range(size):
                        v, u = (first + k, line) if upright else (line, first + k)
                        pattern[k] = ground.gray[v, u] / ground.level
                        variance[k] = ground.variance[v, u] / ground.level**2
                    _fit_column_before_ground(
                        start, first, half, climb, sense, value, slope, noise, full_scale,
                        2 * profile.radius[table], ground.level, ground.fine / ground.level**2,
                        gray, pattern, variance, memory, known.amplitude[i], row,
                    )  # fmt: skip
                row[6] = used - 4
        for field in range(len(row)):
            out[field, i] = row[field]
    return Fits(
        out[0], out[1], out[2], out[3], out[4], out[5],
        out[6].astype(np.int64), out[7].astype(np.int64),
    )  # fmt: skip


@njit
def _fit_column(
    start: float,
    first: int,
    half: int,
    climb: float,
    sense: float,
    value: Floats,
    slope: Floats,
    noise: Noise,
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
            _, sums = _weigh(gray, expected, full_scale, noise, half, weight)
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
    noise: Noise,
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
        w = 0.0 if saturated else 1.0 / pixel_variance(noise, expected[k])
        weight[k] = w
        wg, x = w * gray[k], float(k - half)
        w0, w1, w2 = w0 + w, w1 + w * x, w2 + w * x * x
        g0, g1, gg = g0 + wg, g1 + wg * x, gg + wg * gray[k]
    return used, (w0, w1, w2, g0, g1, gg)


@njit
def _fit_column_before_ground(
    start: float,
    first: int,
    half: int,
    climb: float,
    sense: float,
    value: Floats,
    slope: Floats,
    noise: Noise,
    full_scale: int,
    width: float,
    level: float,
    fine: float,
    gray: Floats,
    pattern: Floats,
    variance: Floats,
    memory: Floats,
    amplitude_at_rest: float,
    fields: Floats,
) -> None:
    """Run Gauss-Newton from `start` and write into `fields`, which is unchanged on failure.

    The ground under the beam's edges depends on the light as well as on the centre: all parameters
    are improved together. They are the line's value and slope, the amplitude, and the centre.
    `memory` (8, n) is for the profile, its derivative, the weights, and the model's derivatives.
    """
    size = len(gray)
    profile, derivative, weight, residual = memory[0], memory[1], memory[2], memory[3]
    design = memory[4:]
    normal, factor, right = np.empty((4, 4)), np.empty((4, 4)), np.empty(4)
    variances = np.empty(4)
    c, b, s, a, chi2 = start, level, 0.0, 0.0, np.inf
    for step in range(MAX_STEPS + 2):
        interpolate_column(value, climb, sense, first - c, profile)
        interpolate_column(slope, climb, sense, first - c, derivative)
        for k in range(size):
            x = float(k - half)
            cover = min(max(width * profile[k], 0.0), 1.0)
            line = b + s * x
            behind = pattern[k] + cover * (1.0 - pattern[k])
            expected = line * behind + a * profile[k]
            if step < 3:
                signal = gray[k] if step == 0 else max(expected, 0.0)
                total = noise.dark + noise.per_gray * signal
                total += (line * (1.0 - cover)) ** 2 * (variance[k] + cover * cover * fine)
                weight[k] = 0.0 if gray[k] >= full_scale else 1.0 / max(total, ROUNDING)
            edge = line * width * (1.0 - pattern[k]) if cover < 1.0 else 0.0
            design[0, k], design[1, k] = behind, x * behind
            design[2, k], design[3, k] = profile[k], -sense * (a + edge) * derivative[k]
            residual[k] = gray[k] - expected
        chi2 = _sum_products(design, weight, residual, normal, right)
        prior = 1.0 / (AMPLITUDE_SIGMA * amplitude_at_rest) ** 2
        normal[2, 2] += prior
        right[2] += prior * (amplitude_at_rest - a)
        if step == 0:
            # The line and the amplitude alone are fitted.
            normal[3, :] = normal[:, 3] = right[3] = 0.0
            normal[3, 3] = 1.0
        copy_into(factor, normal)
        if not solve_definite(factor, right):
            return
        b, s, a = b + right[0], s + right[1], a + right[2]
        c += min(max(right[3], -0.5), 0.5)
        if abs(c - start) > half - 2:
            return
        if step > 3 and abs(right[3]) < TOLERANCE_PX:
            break
    for p in range(4):
        copy_into(factor, normal)
        right[:] = 0.0
        right[p] = 1.0
        if not solve_definite(factor, right):
            return
        variances[p] = right[p]
    fields[0], fields[1], fields[2] = c, np.sqrt(variances[3]), a
    fields[3], fields[4], fields[5] = np.sqrt(variances[2]), b, chi2


@njit(fastmath=FAST)
def _sum_products(
    design: Floats, weight: Floats, residual: Floats, normal: Floats, right: Floats
) -> float:
    """Write the weighted products of a design (4, n) with itself and with residuals; return chi^2.

    `normal` is (4, 4) and `right` (4,).
    """
    for p in range(4):
        for q in range(p + 1):
            total = 0.0
            for k in range(residual.size):
                total += weight[k] * design[p, k] * design[q, k]
            normal[p, q] = normal[q, p] = total
        total = 0.0
        for k in range(residual.size):
            total += weight[k] * design[p, k] * residual[k]
        right[p] = total
    chi2 = 0.0
    for k in range(residual.size):
        chi2 += weight[k] * residual[k] * residual[k]
    return chi2
