"""Points of the beam at rest, the mean of its images place by place, and fits to them.

Of their errors some follow the pixel grid, and repeat from image to image.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from solver.at_rest.thresholds import THRESHOLDS
from solver.calibrate import Calibration
from solver.centreline import Centreline
from solver.centreline.section_on_ground import NO_GROUND_ERRORS, GroundErrors
from solver.centreline.smooth import LAG, REST_DEGREE
from solver.core.correlation import correlation_length
from solver.instrument.arrays import Floats
from solver.instrument.grid_error import GridError
from solver.instrument.medians import SIGMA_OVER_MAD
from solver.planes.plane_c import on_plane

# Number of harmonics that describe errors with the period of the pixel rows (chosen), where there
# are more independent errors than coefficients: five of the bow and two per harmonic.
HARMONICS = 2
GRID_COEFFICIENTS = 5 + 2 * HARMONICS
# Rounds in which a beam's place and the error there are improved. Chosen: for waves of a tenth of a
# pixel and a period of two, each leaves a third of the difference.
_ROUNDS: Final = 4
# Least sigma [px] of errors that are alike in all rows. Measured: in images as a sensor takes them,
# a section that is not exactly that of the beam leaves waves of this size.
GRID_ERROR_PX: Final = 0.002


class RestPoints(NamedTuple):
    """Mean of the rest images: points (n, 2) on C [m] and their sigma (n,) along y [m].

    `random` is the part of the points' variance that differs from image to image or comes from a
    known ground, over the square of sigma; `smooth` is what is added to it in smooth courses, where
    neighbours on one grain of the ground err as one.
    `row` (n,) [px] is the points' position on the pixel grid, across the beam; `pixel` [m] is the
    size of a pixel. `grid` (n, k) is what is left of a known error that repeats with the pixel
    grid, in sigmas of the points by one sigma of each of k independent errors; None where no such
    error has been subtracted. With `rows_alike`, errors that follow the pixel grid are alike in all
    rows.
    """

    points: Floats
    sigma: Floats
    random: float
    row: Floats
    pixel: float
    smooth: float = 0.0
    grid: Floats | None = None
    rows_alike: bool = False

    @property
    def rows(self) -> float:
        """Number of pixel rows that the beam crosses."""
        return float(np.ptp(self.row))

    @property
    def in_common(self) -> float:
        """What LAG neighbours have in common of `random`: all, if they are on one grain."""
        return min(self.smooth / LAG, self.random)


def mean_points(
    lines: Sequence[Centreline],
    calibration: Calibration,
    of_ground: GroundErrors = NO_GROUND_ERRORS,
) -> RestPoints:
    """Average the images place by place.

    A centre's error on the pixel grid is the same in all of them, so four images are not twice as
    accurate as one.
    """
    pixels = np.vstack([line.points for line in lines])
    if not len(pixels):
        return RestPoints(np.empty((0, 2)), np.empty(0), 1.0, np.empty(0), 0.0)
    directions = np.vstack([line.directions for line in lines])
    sigma = np.concatenate([line.sigma for line in lines])
    _, first, index, count = np.unique(
        np.concatenate([place_keys(line) for line in lines]),
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    mean = np.column_stack([np.bincount(index, pixels[:, i]) / count for i in (0, 1)])
    mean_sigma = np.bincount(index, sigma) / count
    deviations = ((pixels - mean[index]) ** 2).sum(axis=1) / mean_sigma[index] ** 2
    repeated = count > 1
    # A single image cannot separate noise from errors that repeat: its sigma is used.
    random = 1.0
    if repeated.any():
        squares = np.bincount(index, deviations)[repeated] / (count[repeated] - 1)
        random = float(np.mean(squares / count[repeated]))
    points, vectors = on_plane(calibration.camera, mean, directions[first] * mean_sigma[:, None])
    # Of an error measured obliquely to the beam, only the part across the beam counts.
    order = np.argsort(points[:, 0])
    tilt = math.atan(np.polyfit(points[:, 0], points[:, 1], 1)[0]) if len(points) > 2 else 0.0
    across = np.abs(vectors @ [-math.sin(tilt), math.cos(tilt)]) / math.cos(tilt)
    row = (mean * directions[first]).sum(axis=1)
    pixel = float(np.median(across / mean_sigma))
    grid, error = None, lines[0].grid_error
    if error is not None:
        upright = directions[first, 1] != 0
        left = error.errors_at(*np.where(upright, mean.T, mean.T[::-1])) / mean_sigma[:, None]
        grid = np.where((upright == error.upright)[:, None], left, 0.0)[order]
    return RestPoints(
        points[order],
        np.maximum(across[order], 1e-12),
        random * (1 + of_ground.whole),
        row[order],
        pixel,
        random * of_ground.smooth,
        grid,
    )


def with_grid_error(line: Centreline) -> Centreline:
    """Return a centreline as it was measured, with the error that repeats with the pixel grid."""
    error = line.grid_error
    if error is None:
        return line
    moved, column = (line.directions[:, 1] != 0) == error.upright, int(not error.upright)
    along, corrected = line.points[moved, column], line.points[moved, 1 - column]
    measured = corrected
    for _ in range(_ROUNDS):
        measured = corrected + error.at(along, _course(along, measured))
    points = line.points.copy()
    points[moved, 1 - column] = measured
    return replace(line, points=points, grid_error=None)


def without_grid_error(line: Centreline, error: GridError) -> Centreline:
    """Subtract an error that repeats with the pixel grid from a centreline of the beam at rest.

    Of its own error, which the line may have lost, it shows only waves that it crosses often.
    """
    own, moved = line.grid_error, (line.directions[:, 1] != 0) == error.upright
    if np.count_nonzero(moved) < THRESHOLDS.min_points:
        return line
    if own is not None and (own.upright != error.upright or own.longest >= error.longest):
        return line
    line, column, error = with_grid_error(line), int(not error.upright), error.across
    along, measured = line.points[moved, column], line.points[moved, 1 - column]
    course, shift = _course(along, measured), np.zeros_like(measured)
    # The error is that of the beam's true place, which the error itself has moved.
    for _ in range(_ROUNDS):
        shift = error.at(along, course)
        course = _course(along, measured - shift)
    points = line.points.copy()
    points[moved, 1 - column] = measured - shift
    return replace(line, points=points, grid_error=error)


def _course(along: Floats, centre: Floats) -> Floats:
    """Fit the smooth course (n,) of centres (n,) of a beam at rest."""
    fitted = np.polynomial.Polynomial.fit(along, centre, int(REST_DEGREE))
    return np.asarray(fitted(along))


def place_keys(line: Centreline) -> Floats:
    """Number every place that is read: columns count from 0 up, rows down from -1."""
    columns = line.directions[:, 1] != 0
    return np.asarray(np.where(columns, line.points[:, 0], -1 - line.points[:, 1]))


def centres(line: Centreline) -> Floats:
    """Return each point's position in its column or row."""
    return np.asarray((line.points * line.directions).sum(axis=1))


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


def fit_columns(points: RestPoints, design: Floats, y: Floats) -> LinearFit:
    """Fit y (n,) at the points by the columns of a design (n, m).

    The covariance is inflated by the residuals' variance and their correlation length. Errors of
    compression and processing repeat from image to image and follow the pixel grid: for a beam that
    crosses R rows, the mean holds only R + 1 independent ones, and m coefficients explain m of
    them. Where the beam crosses many rows, errors with the period of a row are fitted as well.
    Where these errors are known, what is left of them is added instead; where they are alike in
    all rows, what the fit cannot tell from waves.
    """
    m = design.shape[1]
    if points.rows + 1 > GRID_COEFFICIENTS:
        design = np.column_stack([design, _waves(points)])
    # A harmonic has no mean over a row: it explains none of the rows' errors.
    n, spare_rows = len(y), points.rows + 1 - m
    whitened = design / points.sigma[:, None]
    inverse: Floats = np.linalg.pinv(whitened.T @ whitened, hermitian=True).astype(np.float64)
    coefficients = inverse @ (whitened.T @ (y / points.sigma))
    residual = (y - design @ coefficients) / points.sigma
    # Without outliers, so that an object beside the beam does not hide a bow.
    size = np.abs(residual)
    inliers = residual[size < 3 * SIGMA_OVER_MAD * np.median(size) + 1e-12]
    variance = max(float(np.mean(residual**2)), 1e-12)
    inlier_variance = float(np.mean(inliers**2))
    correlation = correlation_length(residual)
    repeated = n * max(
        _repeating(inlier_variance, n, points),
        _shared_by_neighbours(inliers, points).significant,
    )
    # Errors of the ground are not larger than the residuals show.
    smooth = points.smooth * min(variance / points.random, 1.0)
    independent = max(variance * correlation, variance + smooth)
    if points.rows_alike:
        covariance = _beside_waves(points, whitened[:, :m], residual, independent)
    elif points.grid is None:
        shared = _shared_by_neighbours(residual, points)
        in_rows = _variance_of_rows(spare_rows, shared, variance, n, points)
        covariance = max(independent, n * in_rows) * inverse
    else:
        by_grid = inverse @ (whitened.T @ points.grid)
        # What neighbours still have in common belongs to rows, of which the rest shows few.
        in_rows = _shared_by_neighbours(residual, points).significant / max(points.rows + 1, 1.0)
        covariance = max(independent, n * in_rows) * inverse
        covariance += by_grid @ by_grid.T
    return LinearFit(
        coefficients[:m],
        covariance[:m, :m],
        inverse[:m, :m] * (points.random + smooth),
        float(residual @ residual),
        max(max(inlier_variance, 1.0) * correlation, inlier_variance + smooth),
        repeated / spare_rows if spare_rows > 0 else math.inf,
    )


def _waves(points: RestPoints) -> Floats:
    """Compute the sines and cosines (n, 2 HARMONICS) of the points' places within their rows."""
    phase = 2 * np.pi * np.outer(points.row, np.arange(1, HARMONICS + 1))
    return np.column_stack([np.sin(phase), np.cos(phase)])


def _beside_waves(points: RestPoints, design: Floats, residual: Floats, variance: float) -> Floats:
    """Compute the covariance (m, m) of a fit by a whitened `design` (n, m), beside unknown waves.

    Errors that are alike in all rows are waves, in sigmas of the points, which show those that look
    unlike the design. Of the others the prior sigma is that of all that repeats in the `residual`
    (n,), GRID_ERROR_PX at least. `variance` is that of independent points.
    """
    m = design.shape[1]
    least = (GRID_ERROR_PX * points.pixel / float(np.median(points.sigma))) ** 2
    repeating = _repeating(float(np.mean(residual**2)), len(residual), points)
    expected = max(repeating, _shared_by_neighbours(residual, points).significant, least)
    both = np.column_stack([design, _waves(points)])
    # The columns differ by orders of magnitude.
    size = np.sqrt((both**2).sum(axis=0))
    prior = np.zeros(both.shape[1])
    prior[m:] = variance / expected
    information = (both / size).T @ (both / size) + np.diag(prior / size**2)
    inverse = np.linalg.pinv(information, hermitian=True)[:m, :m] / np.outer(size[:m], size[:m])
    return np.asarray(variance * inverse)


def _variance_of_rows(
    spare_rows: float, shared: "_Shared", variance: float, n: int, points: RestPoints
) -> float:
    """Estimate the variance of one row's error, as the fit's coefficients contain it.

    `variance` is that of the n residuals, which show the errors of the spare rows. Without a spare
    row they may be as large as all that repeats from image to image, and never larger.
    """
    shown = min(max(spare_rows, 0.0), 1.0)
    most = max(_repeating(variance, n, points), shared.significant)
    measured = min(shared.at_most, most)
    return shown * measured / max(spare_rows, 1.0) + (1 - shown) * most


def _repeating(variance: float, n: int, points: RestPoints) -> float:
    """Estimate the part of a variance of n residuals that repeats from image to image.

    It is 0 unless chance would exceed it in fewer than one rig of a thousand.
    """
    repeating = variance - points.random
    return repeating if repeating > 3.1 * math.sqrt(2 / n) * (variance + points.random) else 0.0


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


def _shared_by_neighbours(residual: Floats, points: RestPoints) -> _Shared:
    """Estimate the part of the variance of residuals (n,) that neighbours have in common.

    It is the variance of means over LAG neighbours, minus the part of independent errors in it.
    Errors that alternate from column to column, as those of a colour mosaic, cancel. Those by a
    known ground do not follow the pixel grid: they are subtracted.
    """
    n, white = len(residual), float(np.mean(residual**2)) / LAG
    if n < 2 * LAG:
        return _Shared(0.0, 0.0)
    means = np.convolve(residual, np.full(LAG, 1 / LAG), "valid")
    return _Shared(
        float(np.mean(means**2)) - white - points.in_common, 3.1 * math.sqrt(2 * LAG / n) * white
    )
