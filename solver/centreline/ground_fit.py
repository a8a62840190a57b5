"""Profile fit before a ground that is known from the rest images.

A column shows the ground, dimmed or brightened by a straight line, where the beam does not cover
it; under the beam, the ground's typical level takes its place, so that the beam's amplitude is
the contrast with that level everywhere. Amplitude, centre and the straight line are estimated
together, weighted with the noise of the image and of the ground.
"""

import numpy as np
import numpy.typing as npt

from solver.centreline.columns import interpolate_profile, read_column
from solver.centreline.ground import Ground, Pattern
from solver.centreline.noise import ROUNDING, Noise
from solver.centreline.profile import Profile
from solver.centreline.profile_fit import MAX_STEPS, TOLERANCE_PX, Fits, fit_profiles
from solver.centreline.stations import Stations
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey, copy_into
from solver.instrument.compiled import FAST, njit
from solver.instrument.small_matrices import solve_definite


def fit_columns(
    image: Grey,
    places: Stations,
    profile: Profile,
    noise: Noise,
    half: int,
    full_scale: int,
    ground: Ground | None,
    expected: Floats,
) -> Fits:
    """Fit as `fit_profiles`, before a known ground if there is one.

    `expected` (n,) [gray px] are the amplitudes at rest, from which those of the image may differ
    by AMPLITUDE_SIGMA: where the ground is not known, it looks like a part of the beam.

    Where an object or its shadow hides the ground, the known ground explains a column worse than
    a straight line does: the better of both fits is kept.
    """
    plain = fit_profiles(image, places, profile, noise, half, full_scale)
    if ground is None:
        return plain
    table = profile.nearest(places.length)
    fields = _fit(
        image,
        ground.gray,
        ground.variance,
        places.along,
        places.start,
        np.abs(places.climb),
        places.upright,
        places.sense,
        table,
        profile.value,
        profile.slope,
        noise.dark,
        noise.per_gray,
        half,
        full_scale,
        2 * profile.radius[table],
        ground.level,
        ground.fine,
        expected,
    )
    before = Fits(
        centre=fields[0],
        sigma=fields[1],
        amplitude=fields[2],
        amplitude_sigma=fields[3],
        background=fields[4],
        chi2=fields[5],
        dof=fields[6].astype(np.int64),
        saturated=fields[7].astype(np.int64),
    )
    unlikely = before.chi2 > THRESHOLDS.max_misfit * np.maximum(before.dof, 1)
    keep = np.isfinite(before.sigma) & ~(unlikely & (plain.chi2 < before.chi2))
    return Fits(
        *(
            np.where(keep, ours, theirs)
            for ours, theirs in zip(vars(before).values(), vars(plain).values(), strict=True)
        )
    )


# Relative sigma of the amplitude since rest. Chosen: light and shade change it by less, and where
# the image determines it better, this has no weight.
AMPLITUDE_SIGMA = 0.2


@njit
def _fit(
    image: Grey,
    ground: Pattern,
    ground_variance: Pattern,
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
    width: Floats,
    level: float,
    fine: float,
    amplitude_at_rest: Floats,
) -> Floats:
    """Fit all stations; return the fields of `Fits` (8, n)."""
    n, size = len(along), 2 * half + 1
    out = np.zeros((8, n))
    columns = np.empty((8, size))
    gray, pattern, variance = np.empty(size), np.empty(size), np.empty(size)
    for i in range(n):
        out[1, i] = out[3, i] = np.inf
        first = int(np.rint(start[i])) - half
        if not read_column(image, along[i], upright[i], first, gray):
            continue
        for k in range(size):
            row, column = (first + k, along[i]) if upright[i] else (along[i], first + k)
            pattern[k] = ground[row, column] / level
            variance[k] = ground_variance[row, column] / level**2
        used = 0
        for k in range(size):
            used += gray[k] < full_scale
        out[7, i] = size - used
        if used < THRESHOLDS.min_pixels:
            continue
        _fit_column(
            start[i], first, half, min(climb[i], 1.0), sense[i], value[table[i]], slope[table[i]],
            dark, per_gray, full_scale, width[i], level, fine / level**2, gray, pattern, variance,
            columns, amplitude_at_rest[i], out[:, i],
        )  # fmt: skip
        out[6, i] = used - 4
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
    width: float,
    level: float,
    fine: float,
    gray: Floats,
    pattern: Floats,
    variance: Floats,
    columns: Floats,
    amplitude_at_rest: float,
    fields: Floats,
) -> None:
    """Run Gauss-Newton from `start` and write into `fields`, which is unchanged on failure.

    The parameters are the line's value and slope, the amplitude, and the centre. `columns` (8, n)
    is memory for the profile, its derivative, the weights, and the model's derivatives.
    """
    size = len(gray)
    profile, derivative, weight, residual = columns[0], columns[1], columns[2], columns[3]
    design = columns[4:]
    normal, factor, right = np.empty((4, 4)), np.empty((4, 4)), np.empty(4)
    variances = np.empty(4)
    c, b, s, a, chi2 = start, level, 0.0, 0.0, np.inf
    for step in range(MAX_STEPS + 2):
        interpolate_profile(value, climb, sense, first - c, profile)
        interpolate_profile(slope, climb, sense, first - c, derivative)
        for k in range(size):
            x = float(k - half)
            cover = min(max(width * profile[k], 0.0), 1.0)
            line = b + s * x
            behind = pattern[k] + cover * (1.0 - pattern[k])
            expected = line * behind + a * profile[k]
            if step < 3:
                signal = gray[k] if step == 0 else max(expected, 0.0)
                behind_variance = variance[k] + cover * cover * fine
                total = dark + per_gray * signal + (line * (1.0 - cover)) ** 2 * behind_variance
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
