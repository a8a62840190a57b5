"""Fit of the error that repeats with the pixel grid, in one image of a bent beam.

A colour mosaic, a change of size and the blocks of a compression treat pixels differently, with a
period of a few pixels; so does a section that is not exactly the beam's. They move a centre by an
error that depends on where the beam is on the grid. A beam at rest hardly crosses pixel rows, so
that this error looks like a bow; a bent beam crosses dozens, along which it is a sum of waves of
known frequencies (orthogonal matching pursuit; Pati, Rezaiifar and Krishnaprasad 1993).
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.centreline.stations import Stations
from solver.core.correlation import correlation_length
from solver.instrument.arrays import Floats, Mask
from solver.instrument.grid_error import GridError
from solver.instrument.medians import SIGMA_OVER_MAD

# Highest frequency across the beam [1/px]. Chosen: the error of a demosaiced image has steps, which
# waves up to 2 leave a fifth of.
_HIGHEST: Final = 4
# Periods that a beam crosses at least, for a wave across it. Chosen: fewer look like a bend.
_MIN_CROSSED: Final = 5.0
# Decrease of chi^2 by a wave, at which it is accepted. Derived: of 200 waves with two coefficients,
# noise alone decreases it by as much in one image of 16 000.
_MIN_GAIN: Final = 30.0
# Highest frequency across the beam [1/px] of waves that are fitted whether or not they are
# significant: at rest, small ones look like a bow. Chosen: compression leaves waves of 1 and 2.
_ALWAYS: Final = 2
# Largest number of waves. Chosen: a demosaiced image has 8 to 12.
_MAX_WAVES: Final = 24
# Terms of the smooth course along the beam that are fitted beside the waves. Chosen: as of the
# curve whose residuals are fitted, and two more.
_COURSE_TERMS: Final = 10
# Residuals beyond this many robust sigmas do not count. Chosen: an arcsine's largest is at 1.4.
_CUT: Final = 5.0
# Least eigenvalue of the normal equations, over the largest. Chosen: the sine of a wave of half a
# cycle per column is 0 everywhere.
_REGULAR: Final = 1e-10


def fit_grid_error(
    places: Stations, across: Floats, residual: Floats, used: Mask, period: int
) -> GridError | None:
    """Fit waves to the `residual` (n,) [px] of the `used` centres (n,) at n stations.

    `across` (n,) [px] is the beam's smooth course in the columns. Only columns are used, or only
    rows, whichever are more. `period` [px] is that of the grid. Waves along the beam, and those of
    high frequency, have to be significant. Return None for a beam that does not cross the grid, and
    for too few centres.
    """
    upright = bool(2 * np.count_nonzero(places.upright[used]) >= np.count_nonzero(used))
    used = used & (places.upright == upright)
    if np.count_nonzero(used) < 2 * (_COURSE_TERMS + 2 * _MAX_WAVES):
        return None
    frequencies = _frequencies(float(np.ptp(across[used])), period)
    if not (frequencies[:, 1] > 0).any():
        return None
    t = places.length[used]
    t = 2 * (t - t.min()) / max(float(np.ptp(t)), 1e-12) - 1
    smooth = np.linalg.qr(np.polynomial.chebyshev.chebvander(t, _COURSE_TERMS - 1))[0]
    phase = 2 * np.pi * np.column_stack([places.along[used], across[used]]) @ frequencies.T
    waves = _beside(smooth, np.stack([np.cos(phase), np.sin(phase)]).transpose(1, 0, 2))
    y = _beside(smooth, residual[used])
    always = [i for i, (a, b) in enumerate(frequencies) if a == 0 and b <= _ALWAYS]
    # Outliers are found twice: beside the course, and beside the waves.
    good = _inliers(y)
    found, solution, _, _ = _pursuit(waves[good], always, y[good])
    good = _inliers(y - _design(waves, found) @ solution)
    found, solution, design, left = _pursuit(waves[good], always, y[good])
    variance = _variance(left) * correlation_length(left)
    covariance = variance * np.linalg.pinv(design.T @ design, _REGULAR, hermitian=True)
    return GridError(upright, frequencies[found], solution, np.asarray(covariance))


def _inliers(residual: Floats) -> Mask:
    size = np.abs(residual)
    return np.asarray(size < _CUT * SIGMA_OVER_MAD * np.median(size) + 1e-12)


class _Fit(NamedTuple):
    """Waves that were found, their coefficients (2 k,), design (n, 2 k) and residuals (n,)."""

    found: list[int]
    solution: Floats
    design: Floats
    left: Floats


def _pursuit(waves: Floats, found: list[int], y: Floats) -> _Fit:
    """Fit y (n,) by the `found` of the waves (n, 2, m) and by those that are significant."""
    fit = _least_squares(waves, found, y)
    while len(fit.found) < _MAX_WAVES:
        strongest = int(np.argmax((np.tensordot(fit.left, waves, 1) ** 2).sum(axis=0)))
        wider = _least_squares(waves, [*fit.found, strongest], y)
        gain = float(fit.left @ fit.left - wider.left @ wider.left)
        if gain < _MIN_GAIN * _variance(wider.left):
            break
        fit = wider
    return fit


def _least_squares(waves: Floats, found: list[int], y: Floats) -> _Fit:
    design = _design(waves, found)
    solution = np.linalg.lstsq(design, y, rcond=math.sqrt(_REGULAR))[0]
    return _Fit(found, np.asarray(solution, np.float64), design, y - design @ solution)


def _design(waves: Floats, found: list[int]) -> Floats:
    """Return the cosines, and then the sines, of the waves that were found: (n, 2 k)."""
    return waves[:, :, found].reshape(len(waves), -1)


def _variance(residual: Floats) -> float:
    return max(float(residual @ residual) / len(residual), 1e-12)


def _beside(smooth: Floats, values: Floats) -> Floats:
    """Remove from values (n, ...) what an orthonormal basis (n, k) explains."""
    return np.asarray(values - np.tensordot(smooth, np.tensordot(smooth.T, values, 1), 1))


def _frequencies(rows: float, period: int) -> Floats:
    """Return the frequencies (m, 2) [1/px] along a beam that crosses `rows` [px], and across it.

    Of waves along the beam alone, a frequency and its negative are one.
    """
    orders = range(1, period * _HIGHEST + 1)
    waves = [(j / period, 0.0) for j in range(1, period // 2 + 1)]
    waves += [
        (j / period, k / period)
        for k in orders
        for j in range(period)
        if k / period * rows >= _MIN_CROSSED
    ]
    return np.array(waves).reshape(-1, 2)
