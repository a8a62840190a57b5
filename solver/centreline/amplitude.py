"""Beam brightness in columns where the centre is known, or beyond the beam's end."""

import numpy as np
import numpy.typing as npt

from solver.centreline.columns import interpolate_profile, read_column
from solver.centreline.noise import ROUNDING, Noise
from solver.centreline.profile import Profile
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit


def fit_amplitudes(
    image: Grey,
    places: Stations,
    which: npt.NDArray[np.int64],
    centre: Floats,
    profile: Profile,
    noise: Noise,
    half: int,
    full_scale: int,
) -> tuple[Floats, Floats, Floats]:
    """Fit amplitude and background at stations `which` (m,) with known `centre` (m,).

    Return amplitude, its variance and background, each (m,); NaN where the image ends.
    """
    fields = _fit_amplitudes(
        image,
        places.along[which],
        centre,
        np.abs(places.climb[which]),
        places.upright[which],
        places.sense[which],
        profile.nearest(places.length[which]),
        profile.value,
        noise.dark,
        noise.per_gray,
        half,
        full_scale,
    )
    return fields[0], fields[1], fields[2]


@njit
def _ground(weight: Floats, values: Floats, half: int) -> tuple[float, float]:
    """Fit a weighted straight line to values; return its value at the middle and its slope."""
    w0 = w1 = w2 = v0 = v1 = 0.0
    for k in range(len(values)):
        x = k - half
        w0 += weight[k]
        w1 += weight[k] * x
        w2 += weight[k] * x * x
        v0 += weight[k] * values[k]
        v1 += weight[k] * values[k] * x
    det = w0 * w2 - w1 * w1
    return (w2 * v0 - w1 * v1) / det, (w0 * v1 - w1 * v0) / det


@njit
def _fit_amplitudes(
    image: Grey,
    along: npt.NDArray[np.int64],
    centre: Floats,
    climb: Floats,
    upright: npt.NDArray[np.bool_],
    sense: Floats,
    table: npt.NDArray[np.int64],
    value: Floats,
    dark: float,
    per_gray: float,
    half: int,
    full_scale: int,
) -> Floats:
    n, size = len(along), 2 * half + 1
    out = np.full((3, n), np.nan)
    gray, weight, p = np.empty(size), np.empty(size), np.empty(size)
    for i in range(n):
        first = int(np.rint(centre[i])) - half
        if not read_column(image, along[i], upright[i], first, gray):
            continue
        # Equal weights: with weights by noise, the dark side of a column that the beam's end cuts
        # in two would weigh more than the bright one, and the estimated end would be too near.
        for k in range(size):
            weight[k] = 0.0 if gray[k] >= full_scale else 1.0
        interpolate_profile(value[table[i]], min(climb[i], 1.0), sense[i], first - centre[i], p)
        p0, p1 = _ground(weight, p, half)
        norm = product = noise_sum = 0.0
        for k in range(size):
            residual = weight[k] * (p[k] - p0 - p1 * (k - half))
            norm += residual * p[k]
            product += residual * gray[k]
            noise_sum += residual * residual * max(dark + per_gray * gray[k], ROUNDING)
        g0, _ = _ground(weight, gray, half)
        a = product / norm
        out[0, i], out[1, i], out[2, i] = a, noise_sum / norm**2, g0 - a * p0
    return out
