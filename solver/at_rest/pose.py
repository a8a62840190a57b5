"""Beam before contact: its position at the clamp, its direction, and its bow.

Errors of the camera's calibration, of light from one side and of the mounting are the same before
contact and after it; the rest images show them, and they are subtracted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from solver.at_rest.thresholds import LIMITS
from solver.calibrate import Calibration
from solver.centreline import Centreline
from solver.centreline.smooth import LAG
from solver.fitting.correlation import correlation_length
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig
from solver.planes.plane_c import on_plane
from solver.planes.sag import correct_for_sag

# Largest error [px] of a centre that processing shifts to the middle of its pixel row: a larger bow
# is not an effect of the pixel grid.
MAX_GRID_ERROR_PX = 0.5
# Number of harmonics that describe errors with the period of the pixel rows (chosen), where there
# are more independent errors than coefficients: five of the bow and two per harmonic.
HARMONICS = 2
GRID_COEFFICIENTS = 5 + 2 * HARMONICS
# Fewest points of a fit of the bow. Chosen: ten for each coefficient.
MIN_BOW_POINTS = 50
# Bow [px] that a straight beam's image may have. Measured: on a hundred rigs drawn at random it was
# 0.001 to 0.05 px, with this root mean square.
SMALL_BOW_PX = 0.02


@dataclass(frozen=True)
class Rest:
    """The beam before contact, on plane C: y = y_at_clamp + slope x + bow(x), x from the clamp [m].

    `bow` (3,) are the coefficients of x^2, x^3, x^4 in units of the beam's `length` [m]; they are
    zero for a beam that is straight within the noise. `covariance` (5, 5) is that of
    (y_at_clamp, slope, bow). With `bow_undecided` the beam may be bowed, or straight with its image
    shifted to the pixel rows: the bow is zero, and its sigma covers the range of both.
    """

    y_at_clamp: float
    slope: float
    bow: Floats
    covariance: Floats
    length: float
    bow_undecided: bool = False

    @property
    def bent(self) -> bool:
        """Whether the bow is more than noise."""
        if not self.bow.any():
            return False
        significance = self.bow @ np.linalg.pinv(self.covariance[2:, 2:]) @ self.bow
        return bool(significance > LIMITS.bow_chi2)

    @property
    def line_covariance(self) -> Floats:
        """Covariance (2, 2) of the line through the whole curve's error: offset at x = 0, slope.

        Slope and bow are jointly much more certain than each alone.
        """
        return np.asarray(self._line_through @ self.covariance @ self._line_through.T)

    def bow_at(self, x: Floats) -> tuple[Floats, Floats]:
        """Compute the bow (n,) [m] at x (n,) [m] from the clamp, and its sigma about a line."""
        bow, errors = self.bow_errors_at(x)
        return bow, np.sqrt((errors**2).sum(axis=1))

    def bow_errors_at(self, x: Floats) -> tuple[Floats, Floats]:
        """Compute the bow (n,) [m] at x (n,) [m] from the clamp, and its errors about a line.

        The errors (n, 5) [m] are one sigma each of five independent ones.
        """
        curve, line = self._basis(x)
        relative = curve - line @ self._line_through
        return np.asarray(curve[:, 2:] @ self.bow), np.asarray(relative @ self._error_modes)

    @cached_property
    def bow_size(self) -> float:
        """Root mean square [m] of the bow and its sigma together, along the beam."""
        bow, sigma = self.bow_at(np.linspace(0.0, self.length, 50))
        return float(np.sqrt(np.mean(bow**2 + sigma**2)))

    @cached_property
    def _error_modes(self) -> Floats:
        """Matrix (5, 5) M of the coefficients' independent errors: their covariance is M M^T."""
        # In units of the coefficients' own sigmas, which differ by orders of magnitude.
        sigma = np.sqrt(np.diag(self.covariance))
        unit = np.where(sigma > 0, sigma, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(unit, unit))
        return np.asarray(unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))

    def without_bow(self) -> "Rest":
        """Drop the bow and its uncertainty; the line and its covariance stay."""
        covariance = np.zeros((5, 5))
        covariance[:2, :2] = self.line_covariance
        return replace(self, bow=np.zeros(3), covariance=covariance)

    @cached_property
    def _line_through(self) -> Floats:
        """Least-squares line (2, 5) through each of the curve's terms."""
        curve, line = self._basis(np.linspace(0.0, self.length, 50))
        return np.asarray(np.linalg.pinv(line) @ curve)

    def _basis(self, x: Floats) -> tuple[Floats, Floats]:
        curve = _curve(x, self.length)
        return curve, curve[:, :2]


def learn_rest(lines: Sequence[Centreline], calibration: Calibration, rig: Rig) -> Rest:
    """Fit the beam's line, and its bow where there is one, to the mean of the rest images.

    The covariance follows from the points' own scatter. Raises InputError where the images show
    too little of the beam.
    """
    mean = _mean_line(lines, calibration)
    points = correct_for_sag(mean.points, calibration.camera.viewpoint, rig)
    if len(points) < LIMITS.min_points:
        raise InputError(
            f"the rest images show {len(points)} columns of the beam, "
            f"needed are {LIMITS.min_points}"
        )
    length = rig.beam.length
    x, y = points[:, 0] - rig.base_position[0], points[:, 1]
    line = np.column_stack([np.ones_like(x), x])
    curve = _curve(x, length)
    straight = _least_squares(line, y, mean)
    bowed = _least_squares(curve, y, mean)
    c, s = bowed.coefficients, np.append(straight.coefficients, np.zeros(3))
    covariance = np.zeros((5, 5))
    covariance[:2, :2] = straight.covariance
    # Both fits are compared by the scatter about the curve, which fits the beam in either case.
    gain = straight.chi2 - bowed.chi2
    if len(points) > MIN_BOW_POINTS:
        if gain <= LIMITS.bow_chi2 * bowed.scatter:
            return _hardly_bowed(bowed, straight, gain, mean.pixel, length)
        bend = float(np.abs(curve @ (c - s)).max())
        if gain > LIMITS.bow_chi2 * bowed.repeated or bend > MAX_GRID_ERROR_PX * mean.pixel:
            return Rest(float(c[0]), float(c[1]), c[2:], bowed.covariance, length)
        # Uniform from straight to fully bowed: the second moment about zero.
        covariance += np.outer(c - s, c - s) / 3
        return Rest(float(s[0]), float(s[1]), s[2:], covariance, length, bow_undecided=True)
    return Rest(float(s[0]), float(s[1]), s[2:], covariance, length)


def _hardly_bowed(
    bowed: "_LinearFit", straight: "_LinearFit", gain: float, pixel: float, length: float
) -> Rest:
    """Return the beam whose bow is within the noise, with the bow that it may have.

    Errors of the calibration as small as the noise would still move the contact of a beam that is
    hardly bent. The bow's prior is normal, with a root mean square of SMALL_BOW_PX about a line;
    it is subtracted where Akaike's criterion (1974) asks for its three coefficients, whether errors
    are like noise or follow the pixel grid.
    """
    curve = _curve(np.linspace(0.0, length, 50), length)
    line_through = np.linalg.pinv(curve[:, :2]) @ curve
    relative = curve - curve[:, :2] @ line_through
    prior = 3 * relative.T @ relative / len(relative) / (SMALL_BOW_PX * pixel) ** 2
    # (1 + C P)^-1 C is the posterior's covariance also for a P that leaves the line free.
    shrink = np.linalg.solve(np.eye(5) + bowed.covariance @ prior, np.eye(5))
    covariance = shrink @ bowed.covariance
    c = shrink @ bowed.coefficients
    if gain <= 2 * 3 * max(bowed.scatter, bowed.repeated):
        c = np.append(straight.coefficients, np.zeros(3))
        about_line = np.eye(5)
        about_line[:2] -= line_through
        covariance = about_line @ covariance @ about_line.T
        covariance[:2, :2] += straight.covariance
    return Rest(float(c[0]), float(c[1]), c[2:], (covariance + covariance.T) / 2, length)


def disagreements(lines: Sequence[Centreline]) -> Floats:
    """Measure the largest deviation (n,) [px] of each image's beam from the median of all.

    `lines` are the centrelines of n images of the beam at rest. An image that agrees with the
    others within its errors has 0.
    """
    deviations = np.zeros(len(lines))
    centre_by_key = [dict(zip(_keys(line), _centres(line), strict=True)) for line in lines]
    keys = sorted(set.intersection(*map(set, centre_by_key)))
    if len(keys) < LIMITS.min_points:
        return deviations
    centre = np.array([[centres[key] for key in keys] for centres in centre_by_key])
    shape = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, len(keys)), 3)
    for i, difference in enumerate(centre - np.median(centre, axis=0)):
        smooth = shape @ np.linalg.lstsq(shape, difference)[0]
        residual = difference - smooth
        variance = max(float(np.mean(residual**2)), 1e-12) * correlation_length(residual)
        largest = float(np.abs(smooth).max())
        if (
            smooth @ smooth / variance > LIMITS.disagreement_chi2
            and largest > LIMITS.disagreement_px
        ):
            deviations[i] = largest
    return deviations


def _curve(x: Floats, length: float) -> Floats:
    """Compute the terms (n, 5) of the beam's course at rest: a line and a bow."""
    t = x / length
    return np.column_stack([np.ones_like(x), x, t**2, t**3, t**4])


class _MeanLine(NamedTuple):
    """Mean of the rest images: points (n, 2) on C [m] and their sigma (n,) along y [m].

    `random` is the part of the points' variance that differs from image to image, over the square
    of sigma. `row` (n,) [px] is the points' position on the pixel grid, across the beam; `pixel`
    [m] is the size of a pixel.
    """

    points: Floats
    sigma: Floats
    random: float
    row: Floats
    pixel: float

    @property
    def rows(self) -> float:
        """Number of pixel rows that the beam crosses."""
        return float(np.ptp(self.row))


class _LinearFit(NamedTuple):
    """Coefficients (m,), their covariance (m, m), chi^2, and two variance inflations of chi^2.

    `scatter` is that for errors like noise, `repeated` that for errors that follow the pixel grid;
    infinite where the coefficients are as many as those errors, and absorb them.
    """

    coefficients: Floats
    covariance: Floats
    chi2: float
    scatter: float
    repeated: float


def _least_squares(design: Floats, y: Floats, mean: _MeanLine) -> _LinearFit:
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
    n, spare_rows = len(y), mean.rows + 1 - design.shape[1]
    whitened = design / mean.sigma[:, None]
    inverse: Floats = np.linalg.pinv(whitened.T @ whitened, hermitian=True).astype(np.float64)
    coefficients = inverse @ (whitened.T @ (y / mean.sigma))
    residual = (y - design @ coefficients) / mean.sigma
    # Without outliers, so that an object beside the beam does not hide a bow.
    size = np.abs(residual)
    inliers = residual[size < 3 * 1.4826 * np.median(size) + 1e-12]
    variance = max(float(np.mean(residual**2)), 1e-12)
    inlier_variance = float(np.mean(inliers**2))
    correlation = correlation_length(residual)
    shared = _shared_by_neighbours(residual)
    # The spare rows measure the shared variance; one row more counts with its upper bound.
    free_rows, upper_bound = max(spare_rows, 0.0), max(_repeating(variance, n, mean), shared)
    in_rows = n * (free_rows * shared + upper_bound) / (free_rows + 1)
    repeated = n * max(_repeating(inlier_variance, n, mean), _shared_by_neighbours(inliers))
    return _LinearFit(
        coefficients[:m],
        inverse[:m, :m] * max(variance * correlation, in_rows / max(spare_rows, 1.0)),
        float(residual @ residual),
        max(inlier_variance, 1.0) * correlation,
        repeated / spare_rows if spare_rows > 0 else math.inf,
    )


def _repeating(variance: float, n: int, mean: _MeanLine) -> float:
    """Estimate the part of a variance of n residuals that repeats from image to image.

    It is 0 unless chance would exceed it in fewer than one rig of a thousand.
    """
    repeating = variance - mean.random
    return repeating if repeating > 3.1 * math.sqrt(2 / n) * (variance + mean.random) else 0.0


def _shared_by_neighbours(residual: Floats) -> float:
    """Estimate the part of the variance of residuals (n,) that neighbours have in common.

    It is the variance of means over LAG neighbours, minus the part of independent errors in it.
    Errors that alternate from column to column, as those of a colour mosaic, cancel. It is 0 unless
    chance would exceed it in fewer than one rig of a thousand.
    """
    n, white = len(residual), float(np.mean(residual**2)) / LAG
    if n < 2 * LAG:
        return 0.0
    means = np.convolve(residual, np.full(LAG, 1 / LAG), "valid")
    shared = float(np.mean(means**2)) - white
    return shared if shared > 3.1 * math.sqrt(2 * LAG / n) * white else 0.0


def _keys(line: Centreline) -> Floats:
    """Number every place that is read: columns count from 0 up, rows down from -1."""
    columns = line.directions[:, 1] != 0
    return np.asarray(np.where(columns, line.points[:, 0], -1 - line.points[:, 1]))


def _centres(line: Centreline) -> Floats:
    """Return each point's position in its column or row."""
    return np.asarray((line.points * line.directions).sum(axis=1))


def _mean_line(lines: Sequence[Centreline], calibration: Calibration) -> _MeanLine:
    """Average the images place by place.

    A centre's error on the pixel grid is the same in all of them, so four images are not twice as
    accurate as one.
    """
    pixels = np.vstack([line.points for line in lines])
    if not len(pixels):
        return _MeanLine(np.empty((0, 2)), np.empty(0), 1.0, np.empty(0), 0.0)
    directions = np.vstack([line.directions for line in lines])
    sigma = np.concatenate([line.sigma for line in lines])
    _, first, index, count = np.unique(
        np.concatenate([_keys(line) for line in lines]),
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
    return _MeanLine(points[order], np.maximum(across[order], 1e-12), random, row[order], pixel)
