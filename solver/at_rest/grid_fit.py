"""Least squares for errors of which some follow the pixel grid, and repeat from image to image."""

import math
from typing import NamedTuple

import numpy as np

from solver.at_rest.mean_line import MeanLine
from solver.centreline.smooth import LAG
from solver.core.correlation import correlation_length
from solver.instrument.arrays import Floats
from solver.instrument.medians import SIGMA_OVER_MAD

# Number of harmonics that describe errors with the period of the pixel rows (chosen), where there
# are more independent errors than coefficients: five of the bow and two per harmonic.
HARMONICS = 2
GRID_COEFFICIENTS = 5 + 2 * HARMONICS


class LinearFit(NamedTuple):
    """Coefficients (m,), their covariance (m, m), chi^2, and two variance inflations of chi^2.

    `scatter` is that for errors like noise, `repeated` that for errors that follow the pixel grid;
    infinite where the coefficients are as many as those errors, and absorb them.
    `noise_covariance` (m, m) is that of errors that differ from image to image, alone.
    """

    coefficients: Floats
    covariance: Floats
    noise_covariance: Floats
    chi2: float
    scatter: float
    repeated: float


def least_squares(design: Floats, y: Floats, mean: MeanLine) -> LinearFit:
    """Fit y (n,) by the columns of a design (n, m).

    The covariance is inflated by the residuals' variance and their correlation length. Errors of
    compression and processing repeat from image to image and follow the pixel grid: for a beam that
    crosses R rows, the mean holds only R + 1 independent ones, and m coefficients explain m of
    them. Where the beam crosses many rows, errors with the period of a row are fitted as well.
    """
    m = design.shape[1]
    if mean.rows + 1 > GRID_COEFFICIENTS:
        phase = 2 * np.pi * np.outer(mean.row, np.arange(1, HARMONICS + 1))
        design = np.column_stack([design, np.sin(phase), np.cos(phase)])
    # A harmonic has no mean over a row: it explains none of the rows' errors.
    n, spare_rows = len(y), mean.rows + 1 - m
    whitened = design / mean.sigma[:, None]
    inverse: Floats = np.linalg.pinv(whitened.T @ whitened, hermitian=True).astype(np.float64)
    coefficients = inverse @ (whitened.T @ (y / mean.sigma))
    residual = (y - design @ coefficients) / mean.sigma
    # Without outliers, so that an object beside the beam does not hide a bow.
    size = np.abs(residual)
    inliers = residual[size < 3 * SIGMA_OVER_MAD * np.median(size) + 1e-12]
    variance = max(float(np.mean(residual**2)), 1e-12)
    inlier_variance = float(np.mean(inliers**2))
    correlation = correlation_length(residual)
    repeated = n * max(
        _repeating(inlier_variance, n, mean), _shared_by_neighbours(inliers).significant
    )
    in_rows = _variance_of_rows(spare_rows, _shared_by_neighbours(residual), variance, n, mean)
    return LinearFit(
        coefficients[:m],
        inverse[:m, :m] * max(variance * correlation, n * in_rows),
        inverse[:m, :m] * mean.random,
        float(residual @ residual),
        max(inlier_variance, 1.0) * correlation,
        repeated / spare_rows if spare_rows > 0 else math.inf,
    )


def _variance_of_rows(
    spare_rows: float, shared: "_Shared", variance: float, n: int, mean: MeanLine
) -> float:
    """Estimate the variance of one row's error, as the fit's coefficients contain it.

    `variance` is that of the n residuals, which show the errors of the spare rows. Without a spare
    row they may be as large as all that repeats from image to image, and never larger.
    """
    shown = min(max(spare_rows, 0.0), 1.0)
    most = max(_repeating(variance, n, mean), shared.significant)
    measured = min(shared.at_most, most)
    return shown * measured / max(spare_rows, 1.0) + (1 - shown) * most


def _repeating(variance: float, n: int, mean: MeanLine) -> float:
    """Estimate the part of a variance of n residuals that repeats from image to image.

    It is 0 unless chance would exceed it in fewer than one rig of a thousand.
    """
    repeating = variance - mean.random
    return repeating if repeating > 3.1 * math.sqrt(2 / n) * (variance + mean.random) else 0.0


class _Shared(NamedTuple):
    """Part of a variance that neighbours have in common, and the least that is significant."""

    measured: float
    least: float

    @property
    def significant(self) -> float:
        """The part; 0 unless chance would exceed it in fewer than one rig of a thousand."""
        return self.measured if self.measured > self.least else 0.0

    @property
    def at_most(self) -> float:
        """The part, or what would be overlooked."""
        return max(self.measured, self.least)


def _shared_by_neighbours(residual: Floats) -> _Shared:
    """Estimate the part of the variance of residuals (n,) that neighbours have in common.

    It is the variance of means over LAG neighbours, minus the part of independent errors in it.
    Errors that alternate from column to column, as those of a colour mosaic, cancel.
    """
    n, white = len(residual), float(np.mean(residual**2)) / LAG
    if n < 2 * LAG:
        return _Shared(0.0, 0.0)
    means = np.convolve(residual, np.full(LAG, 1 / LAG), "valid")
    return _Shared(float(np.mean(means**2)) - white, 3.1 * math.sqrt(2 * LAG / n) * white)
