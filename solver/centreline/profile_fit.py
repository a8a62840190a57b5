"""Profile fit: in every pixel column, where the beam's known profile fits best.

A column (or a row, where the beam is steep) shows amplitude x profile(v - centre) + background
+ slope (v - middle). The four are found by Gauss-Newton, weighted with the sensor's noise, as
maximum likelihood asks; the centre's variance is that of the linearised fit.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from solver.centreline.noise import ROUNDING, Noise
from solver.centreline.profile import STEP, Profile
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats, Grey

STEPS = 5
CLOSE_ENOUGH_PX = 1e-4
LEAST_PIXELS = 6
# Rows on either side, beyond the profile's own reach, that tell the background.
MARGIN = 2


@dataclass(frozen=True)
class Fits:
    """Profile fits at n stations; a station that could not be fitted has sigma = inf.

    `centre`, its `sigma` [px], `amplitude` and its sigma [gray px], `background` [gray], `chi2` on
    `dof` degrees of freedom, `saturated`: pixels left out because they are at full scale.
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
    """Fit at every station, from its start.

    `half` pixels on either side are fitted; pixels of `full_scale` or more are left out.
    """
    found = _fit(
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
        centre=found[:, 0],
        sigma=found[:, 1],
        amplitude=found[:, 2],
        amplitude_sigma=found[:, 3],
        background=found[:, 4],
        chi2=found[:, 5],
        dof=found[:, 6].astype(np.int64),
        saturated=found[:, 7].astype(np.int64),
    )


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
    """Amplitude, its variance, and background at stations `which` (m,) with known `centre` (m,).

    NaN where the image ends.
    """
    found = _fit_amplitudes(
        image,
        places.along[which],
        centre,
        np.abs(places.climb[which]),
        places.upright[which],
        places.sense[which],
        profile.value,
        noise.dark,
        noise.per_gray,
        half,
        full_scale,
    )
    return found[:, 0], found[:, 1], found[:, 2]


@njit(cache=True, error_model="numpy")
def _fit(  # noqa: PLR0912, PLR0915 - one compiled loop over stations; calls would copy arrays
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
    n, size = len(along), 2 * half + 1
    out = np.zeros((n, 8))
    out[:, 1] = np.inf
    out[:, 3] = np.inf
    gray, weight, p, d = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for i in range(n):
        first = int(np.rint(start[i])) - half
        if not _read(image, along[i], upright[i], first, gray):
            continue
        used = 0
        for k in range(size):
            bright = gray[k] >= full_scale
            used += not bright
            weight[k] = 0.0 if bright else 1.0 / max(dark + per_gray * gray[k], ROUNDING)
        out[i, 7] = size - used
        if used < LEAST_PIXELS:
            continue
        c, a, b, s = start[i], 0.0, 0.0, 0.0
        information = left = 0.0
        for step in range(STEPS + 1):
            _tabulated(value, climb[i], sense[i], first - c, p)
            _tabulated(slope, climb[i], sense[i], first - c, d)
            # Amplitude and ground at this centre are linear. What of the profile and of its
            # derivative the ground (1, x) can imitate is cleared away first.
            p0, p1 = _ground(weight, p, half)
            d0, d1 = _ground(weight, d, half)
            left = left_gray = dp = dd = 0.0
            for k in range(size):
                x = k - half
                clear_p = weight[k] * (p[k] - p0 - p1 * x)
                left += clear_p * p[k]
                left_gray += clear_p * gray[k]
                dp += clear_p * d[k]
                dd += weight[k] * (d[k] - d0 - d1 * x) * d[k]
            if not left > 0:
                break
            a = left_gray / left
            g0, g1 = _ground(weight, gray, half)
            b, s = g0 - a * p0, g1 - a * p1
            # d(gray)/d(centre) = -sense a d, cleared of the amplitude too.
            information = a * a * (dd - dp * dp / left)
            if not information > 0:
                break
            if step == STEPS:
                break
            gradient = 0.0
            for k in range(size):
                gradient += weight[k] * d[k] * (gray[k] - a * p[k] - b - s * (k - half))
            move = -sense[i] * a * gradient / information
            c += min(max(move, -0.5), 0.5)
            if abs(c - start[i]) > half - 2:
                information = 0.0
                break
            if step < 2:
                # Weights by what the model expects, not by what noise made of it.
                for k in range(size):
                    if weight[k] > 0:
                        expected = max(a * p[k] + b + s * (k - half), 0.0)
                        weight[k] = 1.0 / max(dark + per_gray * expected, ROUNDING)
            elif abs(move) < CLOSE_ENOUGH_PX:
                break
        if not (left > 0 and information > 0):
            continue
        chi2 = 0.0
        for k in range(size):
            chi2 += weight[k] * (gray[k] - a * p[k] - b - s * (k - half)) ** 2
        out[i, 0], out[i, 1] = c, 1 / np.sqrt(information)
        out[i, 2], out[i, 3], out[i, 4] = a, 1 / np.sqrt(left), b
        out[i, 5], out[i, 6] = chi2, used - 4
    return out


@njit(cache=True, error_model="numpy")
def _read(image: Grey, line: int, upright: bool, first: int, gray: Floats) -> bool:
    """Fill `gray` from pixel `first` of a column (a row); False where the image ends."""
    height, width = image.shape
    limit, other = (height, width) if upright else (width, height)
    if first < 0 or first + len(gray) > limit or line < 0 or line >= other:
        return False
    for k in range(len(gray)):
        gray[k] = image[first + k, line] if upright else image[line, first + k]
    return True


@njit(cache=True, error_model="numpy")
def _tabulated(table: Floats, climb: float, sense: float, offset: float, out: Floats) -> None:
    """The table at a climb and at pixels offset, offset + 1, ... from the centre."""
    row = min(climb, 1.0) * (table.shape[0] - 1)
    low = min(int(row), table.shape[0] - 2)
    part, middle = row - low, table.shape[1] // 2
    for k in range(len(out)):
        t = sense * (offset + k) / STEP + middle
        j = int(t)
        if t < 0 or j >= table.shape[1] - 1:
            out[k] = 0.0
            continue
        f = t - j
        flatter = table[low, j] * (1 - f) + table[low, j + 1] * f
        steeper = table[low + 1, j] * (1 - f) + table[low + 1, j + 1] * f
        out[k] = flatter * (1 - part) + steeper * part


@njit(cache=True, error_model="numpy")
def _ground(weight: Floats, values: Floats, half: int) -> tuple[float, float]:
    """The weighted straight line (value at the middle, slope) through values."""
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


@njit(cache=True, error_model="numpy")
def _fit_amplitudes(
    image: Grey,
    along: npt.NDArray[np.int64],
    centre: Floats,
    climb: Floats,
    upright: npt.NDArray[np.bool_],
    sense: Floats,
    value: Floats,
    dark: float,
    per_gray: float,
    half: int,
    full_scale: int,
) -> Floats:
    n, size = len(along), 2 * half + 1
    out = np.full((n, 3), np.nan)
    gray, weight, p = np.empty(size), np.empty(size), np.empty(size)
    for i in range(n):
        first = int(np.rint(centre[i])) - half
        if not _read(image, along[i], upright[i], first, gray):
            continue
        # All pixels weigh the same: by their own noise the dark side of a column that the beam's
        # end cuts in two would weigh more than the bright one, and the end come out too near.
        for k in range(size):
            weight[k] = 0.0 if gray[k] >= full_scale else 1.0
        _tabulated(value, climb[i], sense[i], first - centre[i], p)
        p0, p1 = _ground(weight, p, half)
        left = left_gray = noise = 0.0
        for k in range(size):
            clear_p = weight[k] * (p[k] - p0 - p1 * (k - half))
            left += clear_p * p[k]
            left_gray += clear_p * gray[k]
            noise += clear_p * clear_p * max(dark + per_gray * gray[k], ROUNDING)
        g0, _ = _ground(weight, gray, half)
        a = left_gray / left
        out[i, 0], out[i, 1], out[i, 2] = a, noise / left**2, g0 - a * p0
    return out
