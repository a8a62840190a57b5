"""Flags of the columns along a path that do not look like the beam at rest; compiled."""

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from solver.centreline.profile_fit import Fits
from solver.centreline.smooth import (
    DEGREE,
    FINE_DEGREE,
    curve,
    local_scatter,
    running_median,
)
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Mask
from solver.instrument.centreline import Flag
from solver.instrument.compiled import njit
from solver.instrument.medians import median, quantile

HIDDEN, SATURATED, FOREIGN = (int(flag) for flag in (Flag.HIDDEN, Flag.SATURATED, Flag.FOREIGN))
# Number of columns about one that say which misfit is usual there. Chosen: twice what an object
# covers, and few enough for a ground whose structure changes along the beam.
_MISFIT_WIDTH: Final = 61
# Width, in columns, of the local median of the brightness, and the degree of its smooth course.
# Numpy scalars are compiled once, literals anew.
_BRIGHTNESS_WIDTH, _BRIGHTNESS_DEGREE = np.int64(21), np.int64(2)
# Robust standard deviations beyond which a brightness does not count in this course. Chosen: low,
# because a shaded stretch is wide.
_BRIGHTNESS_CUT: Final = 2.5
# A disturbed column's deviation over the median one. Derived: three standard deviations.
_DISTURBED: Final = 4.5


class Columns(NamedTuple):
    """Fits at n stations, and arrays (n,) of their brightness over that at rest, sigmas and flags.

    `noise` [px] is the sigma of the sensor's noise, `sigma` includes the other errors at rest. A
    flag is 0 for a column that looks like the beam.
    """

    fits: Fits
    brightness: Floats
    noise: Floats
    sigma: Floats
    flags: npt.NDArray[np.uint8]


class Expected(NamedTuple):
    """Amplitudes (n,) of a beam that looks as at rest, and the `scale` (n,) of their changes.

    Before a ground whose structure is known, a beam may be as bright as the ground's mean: columns
    whose places are known to `max_sigma` [px], 0 before others, show it by what it hides.
    """

    amplitude: Floats
    scale: Floats
    max_sigma: float


@njit
def flag_columns(
    fits: Fits, expected: Expected, misfit_at_rest: float, sigma_at_rest: float, in_part: bool
) -> Any:
    """Compare columns (n,) with those at rest, and flag those that do not look like the beam.

    Return the fields of `Columns` after the fits. `misfit_at_rest` is the typical chi^2 per degree
    of freedom, and `sigma_at_rest` [px] that of the errors that are not the sensor's noise. The
    profile was seen `in_part` where it is known at some places between the pixels only.
    """
    n = len(expected.amplitude)
    brightness, misfit, noise, sigma = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        change = (fits.amplitude[i] - expected.amplitude[i]) / expected.scale[i]
        brightness[i] = 1 + change * np.sign(expected.amplitude[i])
        misfit[i] = fits.chi2[i] / max(fits.dof[i], 1) / misfit_at_rest
        noise[i] = fits.sigma[i] * np.sqrt(max(misfit[i], 1.0))
        sigma[i] = np.sqrt(noise[i] ** 2 + sigma_at_rest**2)
    # A textured background raises the misfit of every column, and a profile that was seen in part
    # that of the columns at other places between the pixels.
    is_plausible = (brightness >= THRESHOLDS.min_brightness) & (
        brightness <= THRESHOLDS.max_brightness
    )
    plausible = misfit[is_plausible]
    # The columns beyond the beam's last one show no beam.
    end = n
    while end > 0 and not is_plausible[end - 1]:
        end -= 1
    typical_misfit = 1.0
    if len(plausible) > 0:
        share = THRESHOLDS.in_part_share
        typical = quantile(plausible, share) if in_part else median(plausible)
        typical_misfit = max(typical, 1.0)
    flags = np.zeros(n, np.uint8)
    for i in range(n):
        # On a textured background the amplitude must exceed a larger threshold.
        enlarged_sigma = fits.amplitude_sigma[i] * np.sqrt(max(misfit[i], 1.0))
        shown = (
            abs(fits.amplitude[i]) >= THRESHOLDS.amplitude_sigmas * enlarged_sigma
            or noise[i] < expected.max_sigma
        )
        faint = brightness[i] < THRESHOLDS.min_brightness or not shown
        if faint or not fits.sigma[i] < THRESHOLDS.max_sigma_px:
            flags[i] = HIDDEN
        elif brightness[i] > THRESHOLDS.max_brightness or (
            # A beam that comes nearer to the camera looks wider than at rest in all its columns: a
            # foreign object differs from those about it.
            misfit[i] > THRESHOLDS.max_misfit * typical_misfit
            and misfit[i] > THRESHOLDS.max_misfit * min(_usual_misfit(misfit[:end], i), 30.0)
        ):
            flags[i] = FOREIGN
        if flags[i] > 0 and fits.saturated[i] > 0:
            flags[i] = SATURATED
    return brightness, noise, sigma, flags


@njit
def _usual_misfit(misfit: Floats, i: int) -> float:
    """Compute the median of _MISFIT_WIDTH misfits (n,) about the i-th, up to the last one.

    The first one is repeated.
    """
    window = np.empty(_MISFIT_WIDTH)
    last = min(i + _MISFIT_WIDTH // 2, len(misfit) - 1)
    for k in range(_MISFIT_WIDTH):
        window[k] = misfit[max(last - k, 0)]
    return median(window)


@njit
def fit_and_flag_outliers(
    length: Floats, off_path: Floats, sigma: Floats, brightness: Floats, on_beam: Mask, flags: Any
) -> Floats:
    """Fit the smooth course (n,) of centres `off_path`, and flag outliers from it as foreign.

    `sigma` (n,) is enlarged in place where the points scatter by more than it states, as they do
    in compressed or processed images. The course has length 0 if too few points are left.
    """
    n = len(length)
    disturbed = _disturbed_columns(length, brightness, flags, on_beam)
    used_sigma = np.full(n, np.inf)
    for i in range(n):
        if flags[i] == 0 and (disturbed[i] or not on_beam[i]):
            flags[i] = FOREIGN
        if flags[i] == 0:
            used_sigma[i] = sigma[i]
    smooth, inflation = _course(length, off_path, used_sigma)
    if len(smooth) == 0:
        return smooth
    for i in range(n):
        sigma[i] *= inflation
        residual = abs(off_path[i] - smooth[i])
        if flags[i] == 0 and residual > max(
            THRESHOLDS.max_residual_px, THRESHOLDS.max_residual_sigmas * sigma[i]
        ):
            flags[i] = FOREIGN
    # A separate mask: a column that is rejected here does not cause further rejections.
    near_edge = np.zeros(n, np.bool_)
    for i in range(n - 1):
        if flags[i] == FOREIGN and flags[i + 1] == FOREIGN:
            near_edge[max(i - THRESHOLDS.edge_columns, 0) : i + THRESHOLDS.edge_columns + 1] = True
    for i in range(n):
        if near_edge[i] and flags[i] == 0:
            flags[i] = FOREIGN
    return smooth


@njit
def _course(length: Floats, off_path: Floats, sigma: Floats) -> tuple[Floats, float]:
    """Fit the smooth course (n,), and compute the factor by which the points exceed their sigmas.

    The course has length 0 if too few points have a finite sigma.
    """
    smooth = curve(length, off_path, sigma, length, DEGREE, THRESHOLDS.tukey_cut)
    if len(smooth) == 0:
        return smooth, 1.0
    inflation = _sigma_inflation(_normalised(off_path, smooth, sigma))
    if inflation > 1:
        fine = curve(length, off_path, sigma, length, FINE_DEGREE, THRESHOLDS.tukey_cut)
        if len(fine) > 0:
            fine_inflation = _sigma_inflation(_normalised(off_path, fine, sigma))
            # A finer curve does not reduce scatter, but it reduces the misfit of a smooth beam.
            if fine_inflation < THRESHOLDS.max_fine_inflation * inflation:
                smooth, inflation = fine, fine_inflation
    return smooth, inflation


@njit
def _normalised(y: Floats, smooth: Floats, sigma: Floats) -> Floats:
    """Return the residuals of y (n,), in sigmas, where sigma (n,) is finite."""
    residual, count = np.empty(len(y)), 0
    for i in range(len(y)):
        if np.isfinite(sigma[i]):
            residual[count] = (y[i] - smooth[i]) / sigma[i]
            count += 1
    return residual[:count]


@njit
def _sigma_inflation(residual: Floats) -> float:
    """Compute the local scatter of residuals (n,), which are in sigmas; at least 1.

    It is 1 unless white noise would exceed it in fewer than one image of a thousand. The median of
    |x| of n independent values has a relative standard deviation of 1.17 / sqrt(n); the local
    scatter's differences share values, which makes it 1.63 / sqrt(n).
    """
    scatter = local_scatter(residual)
    return scatter if scatter > 1 + 3.1 * 1.63 / np.sqrt(max(len(residual), 1)) else 1.0


@njit
def _disturbed_columns(length: Floats, brightness: Floats, flags: Any, on_beam: Mask) -> Mask:
    """Detect columns (n,) where an object shades or lights the beam, by their brightness.

    An object close to the beam takes light from one of its flanks, and shifts its centre.
    """
    disturbed, count = np.zeros(len(brightness), np.bool_), 0
    index = np.empty(len(brightness), np.int64)
    x, y = np.empty(len(brightness)), np.empty(len(brightness))
    for i in range(len(brightness)):
        # Columns of an object that hides the beam say nothing of its brightness.
        if on_beam[i] and flags[i] == 0:
            index[count], x[count], y[count] = i, length[i], brightness[i]
            count += 1
    sigma = np.full(count, THRESHOLDS.max_brightness_deviation / 3)
    medians = running_median(y[:count], _BRIGHTNESS_WIDTH)
    smooth = curve(x[:count], medians, sigma, x[:count], _BRIGHTNESS_DEGREE, _BRIGHTNESS_CUT)
    if len(smooth) > 0:
        deviation = np.abs(medians / smooth - 1)
        # Under spotted light the threshold rises with the typical deviation.
        threshold = max(THRESHOLDS.max_brightness_deviation, _DISTURBED * median(deviation))
        for k in range(count):
            disturbed[index[k]] = deviation[k] > threshold
    return disturbed
