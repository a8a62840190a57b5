"""Profile fit: position of the beam's known profile in every pixel column.

A column (or a row, where the beam is steep) shows amplitude x profile(v - centre) + background
+ slope (v - middle). The four parameters are estimated by Gauss-Newton, weighted with the sensor's
noise (maximum likelihood); the centre's variance is that of the linearised fit.

This is the contrast with the ground, whose profile is the same in all columns where the ground is
everywhere alike. With a profile of the beam's own light, a gray value is amplitude x profile, and
what the beam's cover leaves of the ground: of the straight line, or of that times a ground that
other images show. Then the noise is that of the image and of the ground. Of a pixel that the beam's
edge divides, one side is seen: the ground's slope between the pixels states what it shows, and the
rest is noise.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.centreline.ground import Ground
from solver.centreline.noise import Noise, pixel_variance
from solver.centreline.profile import (
    Profile,
    interpolate_column,
    nearest_table,
    table_position,
    table_value,
)
from solver.centreline.stations import Stations, read_column
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import FAST, njit

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
    """The `ground` at rest, and the beam's `amplitude` (n,) [gray px] at n stations.

    The amplitudes are those before the ground's level. Those of the image may differ by
    AMPLITUDE_SIGMA: where the ground is not known, it looks like a part of the beam.
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

    `half` pixels on either side are fitted; pixels of `full_scale` or more are left out. Amplitudes
    are the contrast's, also with a profile of the beam's own light, which a known ground needs.

    Where an object or its shadow hides the ground, the known ground explains a column worse than
    a straight line does: the better of both fits is kept.
    """
    cover, profile = profile.cover, profile._replace(cover=None)
    plain: Fits = _fit(image, places, profile, noise, half, full_scale, None, cover)
    if known is None:
        return plain
    before: Fits = _fit(image, places, profile, noise, half, full_scale, known, cover)
    unlikely = before.chi2 > THRESHOLDS.max_misfit * np.maximum(before.dof, 1)
    keep = np.isfinite(before.sigma) & ~(unlikely & (plain.chi2 < before.chi2))
    return Fits(*(np.where(keep, *both) for both in zip(before, plain, strict=True)))


class _Cover(NamedTuple):
    """Profile and its slope of a beam with an even brightness, as in `Profile`, of one section."""

    value: Floats
    slope: Floats


class _Behind(NamedTuple):
    """The ground behind a beam, in one column: a known one, or one that is even.

    `pattern` (n,) are its gray values over its `level`; `variance` (n,) and `fine` are those of
    `Ground`, over the level's square. The beam is `width` [px] wide, with its own light's
    `amplitude` [gray px], which has the weight `prior`.
    """

    pattern: Floats
    variance: Floats
    fine: float
    level: float
    width: float
    amplitude: float
    prior: float


@njit
def _fit(
    image: Grey,
    places: Stations,
    profile: Profile,
    noise: Noise,
    half: int,
    full_scale: int,
    known: KnownGround | None,
    covers: Profile | None,
) -> Fits:
    """Fit all stations: all before the known ground or none, and all with a cover or none.

    Each of the three cases is compiled on its own.
    """
    n, size = len(places.along), 2 * half + 1
    out, row = np.zeros((8, n)), np.empty(8)
    gray, memory = np.empty(size), np.empty((5, size))
    pattern, variance = np.ones(size), np.zeros(size)
    for i in range(n):
        row[:] = 0.0
        row[1] = row[3] = np.inf
        line, upright, start = places.along[i], places.upright[i], places.start[i]
        first = int(np.rint(start)) - half
        if read_column(image, line, upright, first, gray):
            table = nearest_table(profile, places.length[i])
            behind, cover, width = None, None, 2 * profile.radius[table]
            if covers is not None:
                cover = _Cover(covers.value[table], covers.slope[table])
            if known is not None:
                ground = known.ground
                for k in range(size):
                    v, u = (first + k, line) if upright else (line, first + k)
                    pattern[k] = ground.gray[v, u] / ground.level
                    variance[k] = ground.variance[v, u] / ground.level**2
                amplitude = known.amplitude[i] + width * ground.level
                behind = _Behind(
                    pattern, variance, ground.fine / ground.level**2, ground.level,
                    width, amplitude, (AMPLITUDE_SIGMA * amplitude) ** -2,
                )  # fmt: skip
            elif covers is not None:
                # An even ground of unknown level, in units of which the amplitude begins.
                level = max((gray[0] + gray[-1]) / 2, 1.0)
                amplitude = gray.sum() / level - size + width
                behind = _Behind(pattern, variance, 0.0, 1.0, width, amplitude, 0.0)
            _fit_column(
                start, first, half, abs(places.climb[i]), places.sense[i],
                profile.value[table], profile.slope[table],
                noise, full_scale, gray, memory, behind, cover, row,
            )  # fmt: skip
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
    memory: Floats,
    behind: _Behind | None,
    cover: _Cover | None,
    fields: Floats,
) -> None:
    """Run Gauss-Newton from `start` and write into `fields`; on failure, its counts only.

    For a fixed centre, the model is linear in background and amplitude: eliminating the background
    (1, x), or that times the ground, then the profile from the weighted sums of products solves
    their least squares. `memory` is (5, n).
    """
    weight, expected, unknown = memory[0], memory[1], memory[2]
    covered, steepness = memory[3], memory[4]
    c, a, b, s = start, 0.0, 0.0, 0.0
    if behind is not None and cover is not None:
        a, b = behind.amplitude, behind.level
        interpolate_column(value, climb, sense, first - c, expected)
        interpolate_column(cover.value, climb, sense, first - c, covered)
        interpolate_column(cover.slope, climb, sense, first - c, steepness)
        _expect(a, b, s, half, sense, behind, covered, steepness, expected, unknown)
    used = _weigh(gray, gray, unknown, behind, noise, full_scale, weight)
    fields[7] = len(gray) - used
    if used < THRESHOLDS.min_pixels:
        return
    fields[6] = used - 4
    for step in range(MAX_STEPS + 1):
        w0, w1, w2, g0, g1, gg, p0, p1, pp, d0, d1, dp, dd, gp, gd = _products(
            value, slope, climb, sense, first - c, half, gray, weight, expected, behind, cover,
            covered, steepness, a, b, s,
        )  # fmt: skip
        # Make x orthogonal to 1, then subtract each product's part that lies in both.
        mean, per_w0 = w1 / w0, 1 / w0
        per_w2 = 1 / (w2 - mean * w1)
        p1, d1, g1 = p1 - mean * p0, d1 - mean * d0, g1 - mean * g0
        pp = pp - p0 * p0 * per_w0 - p1 * p1 * per_w2
        dp = dp - d0 * p0 * per_w0 - d1 * p1 * per_w2
        dd = dd - d0 * d0 * per_w0 - d1 * d1 * per_w2
        gp = gp - g0 * p0 * per_w0 - g1 * p1 * per_w2
        gd = gd - g0 * d0 * per_w0 - g1 * d1 * per_w2
        gg = gg - g0 * g0 * per_w0 - g1 * g1 * per_w2
        if not pp > 0:
            return
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
            # model at another place, where dark pixels are bright and have a larger noise.
            _expect(a, b, s, half, sense, behind, covered, steepness, expected, unknown)
            _weigh(gray, expected, unknown, behind, noise, full_scale, weight)
        elif abs(update) < TOLERANCE_PX:
            break
    chi2 = gg - a * gp
    if behind is not None:
        chi2 -= behind.prior * (a - behind.amplitude) ** 2
        # The contrast with the ground's level.
        a -= behind.width * b
    fields[0], fields[1], fields[2] = c, 1 / np.sqrt(information), a
    fields[3], fields[4], fields[5] = 1 / np.sqrt(pp), b, max(chi2, 0.0)


@njit
def _expect(
    a: float,
    b: float,
    s: float,
    half: int,
    sense: float,
    behind: _Behind | None,
    covered: Floats,
    steepness: Floats,
    profile: Floats,
    unknown: Floats,
) -> None:
    """Replace the profile (n,) by the model's gray values, and set the variances of its ground."""
    for k in range(len(profile)):
        p, x, u = profile[k], float(k - half), 1.0
        if behind is not None:
            share = behind.width * covered[k]
            u = _beside(behind.pattern, k, share, sense * behind.width * steepness[k])
            within_pixel = share * share * behind.fine
            unknown[k] = ((b + s * x) * (1.0 - share)) ** 2 * (behind.variance[k] + within_pixel)
        profile[k] = max(a * p + b * u + s * x * u, 0.0)


@njit(inline="always")
def _beside(pattern: Floats, k: int, share: float, steep: float) -> float:
    """Compute what a pixel shows of the ground, over its level, beside a beam with a `share` of it.

    What is seen of a pixel is on one side of the beam's edge, where the ground differs from the
    pixel's mean by its slope: `steep` [1/px] is that of the share.
    """
    last = len(pattern) - 1
    slope = 0.5 * (pattern[min(k + 1, last)] - pattern[max(k - 1, 0)])
    return float(pattern[k] * (1.0 - share) - 0.5 * slope * steep * share * (1.0 - share))


@njit(fastmath=FAST)
def _products(
    value: Floats,
    slope: Floats,
    climb: float,
    sense: float,
    offset: float,
    half: int,
    gray: Floats,
    weight: Floats,
    profile: Floats,
    behind: _Behind | None,
    cover: _Cover | None,
    covered: Floats,
    steepness: Floats,
    a: float,
    b: float,
    s: float,
) -> Any:
    """Write the profile (n,), and sum weighted products of all that a column shows.

    They are the products of 1 with 1, x and x^2; of the gray values with 1, x and themselves; of
    the profile with 1, x and itself; of its derivative with 1, x, the profile and itself; and of
    the gray values with both.

    With what the beam hides, 1 and x are times what is seen of the ground, and the derivative
    includes that of the ground under the beam's edges, for the parameters `a`, `b` and `s` of the
    step before. The amplitude at rest is one more observation before a known ground.
    """
    row, column, stride, row_fraction, fraction = table_position(value, climb, sense, offset)
    w0 = w1 = w2 = g0 = g1 = gg = p0 = p1 = pp = d0 = d1 = dp = dd = gp = gd = 0.0
    if behind is not None:
        pp, gp = behind.prior, behind.prior * behind.amplitude
        gg = gp * behind.amplitude
    for k in range(gray.size):
        p = table_value(value, row, column, row_fraction, fraction)
        d = table_value(slope, row, column, row_fraction, fraction)
        column += stride
        profile[k] = p
        w, g, x = weight[k], gray[k], float(k - half)
        u = 1.0
        if behind is not None and cover is not None:
            at = column - stride
            covered[k] = table_value(cover.value, row, at, row_fraction, fraction)
            steepness[k] = table_value(cover.slope, row, at, row_fraction, fraction)
            share, steep = behind.width * covered[k], behind.width * steepness[k]
            u = _beside(behind.pattern, k, share, sense * steep)
            d -= (b + s * x) / a * behind.pattern[k] * steep
        wu, wg, wp, wd = w * u, w * g, w * p, w * d
        wx = wu * x
        w0, w1, w2 = w0 + wu * u, w1 + wx * u, w2 + wx * u * x
        g0, g1, gg = g0 + wu * g, g1 + wx * g, gg + wg * g
        p0, p1, pp = p0 + wu * p, p1 + wx * p, pp + wp * p
        d0, d1, dp, dd = d0 + wu * d, d1 + wx * d, dp + wd * p, dd + wd * d
        gp, gd = gp + wg * p, gd + wg * d
    return w0, w1, w2, g0, g1, gg, p0, p1, pp, d0, d1, dp, dd, gp, gd


@njit(fastmath=FAST)
def _weigh(
    gray: Floats,
    expected: Floats,
    unknown: Floats,
    behind: _Behind | None,
    noise: Noise,
    full_scale: int,
    weight: Floats,
) -> int:
    """Set weights by the noise of expected values, 0 at full scale; return how many are not 0."""
    used = 0
    for k in range(gray.size):
        saturated = gray[k] >= full_scale
        used += not saturated
        variance = pixel_variance(noise, expected[k])
        if behind is not None:
            variance += unknown[k]
        weight[k] = 0.0 if saturated else 1.0 / variance
    return used
