"""Beam before contact: its position at the clamp, its direction, and its bow.

Errors of the camera's calibration, of light from one side and of the mounting are the same before
contact and after it; the rest images show them, and they are subtracted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from solver.at_rest.pattern import NODES, pattern_of, share_that_follows
from solver.at_rest.rest_points import LinearFit, RestPoints, fit_columns, mean_points
from solver.at_rest.thresholds import THRESHOLDS
from solver.calibrate import Calibration
from solver.centreline import Centreline
from solver.centreline.section_on_ground import NO_GROUND_ERRORS, GroundErrors
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig
from solver.planes.sag import correct_for_sag

# Largest error [px] of a centre that processing shifts to the middle of its pixel row: a larger bow
# is not an effect of the pixel grid.
MAX_GRID_ERROR_PX = 0.5
# Fewest points of a fit of the bow. Chosen: ten for each coefficient.
MIN_BOW_POINTS = 50
# Bow [px] that a straight beam's image may have. Measured: on a hundred rigs drawn at random it was
# 0.001 to 0.05 px, with this root mean square. A lens without distortion has none.
SMALL_BOW_PX = 0.02
# Smallest one [px]. Chosen: far below what images determine.
_LEAST_BOW_PX = 1e-5
# Root mean square of t^2 about a line, for t from 0 to 1.
_PARABOLA = 1 / math.sqrt(180)


@dataclass(frozen=True)
class RestLine:
    """The beam before contact, on plane C: y = y_at_clamp + slope x + bow(x), x from the clamp [m].

    `bow` (3,) are the coefficients of x^2, x^3, x^4 in units of the beam's `length` [m]; they are
    zero for a beam that is straight within the noise. `covariance` (5, 5) is that of
    (y_at_clamp, slope, bow). With `bow_undecided` the beam may be bowed, or straight with its image
    shifted to the pixel rows: the bow is zero, and its sigma covers the range of both. `pattern`
    (NODES,) [m] is what the images show beside this course, and `noise_covariance` (5, 5) what
    would be left of the covariance if all of it belonged to the beam; empty where there is none.
    """

    y_at_clamp: float
    slope: float
    bow: Floats
    covariance: Floats
    length: float
    bow_undecided: bool = False
    pattern: Floats = field(default_factory=lambda: np.empty(0))
    noise_covariance: Floats = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def bent(self) -> bool:
        """Whether the bow is more than noise."""
        if not self.bow.any():
            return False
        significance = self.bow @ np.linalg.pinv(self.covariance[2:, 2:]) @ self.bow
        return bool(significance > THRESHOLDS.bow_chi2)

    @cached_property
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
        powers = np.vander(x / self.length, 5, increasing=True)
        return np.asarray(powers[:, 2:] @ self.bow), np.asarray(powers @ self.error_coefficients)

    def pattern_at(self, s: Floats) -> Floats:
        """Interpolate the pattern (n,) [m] at arc lengths `s` (n,) over the length."""
        return np.interp(s, np.linspace(0.0, 1.0, NODES), self.pattern)

    def share_that_follows(self, s: Floats, beside: Floats, sigma: Floats) -> float:
        """Estimate the part of the pattern, from 0 to 1, that a bent beam shows.

        `s` (n,) are its points' arc lengths over the length, in order from the clamp, `beside` (n,)
        [m] their deviations from a smooth course, and `sigma` (n,) [m] the noise of these.
        """
        if not len(self.pattern):
            return 0.0
        return share_that_follows(s, self.pattern_at(s), beside, sigma)

    def following(self, share: float) -> "RestLine":
        """Return the course whose pattern belongs to the beam, but for the part 1 - `share`.

        What moves with the beam is no error of its course.
        """
        left = (1 - share) * (self.covariance - self.noise_covariance)
        return replace(self, covariance=self.noise_covariance + left)

    @cached_property
    def bow_size(self) -> float:
        """Root mean square [m] of the bow and its sigma together, along the beam."""
        bow, sigma = self.bow_at(_along(self.length))
        return float(np.sqrt(np.mean(bow**2 + sigma**2)))

    @cached_property
    def error_coefficients(self) -> Floats:
        """Coefficients (5, 5) [m] of 1 to x^4, x over the length, of each error about a line."""
        about_line = self._error_modes.copy()
        about_line[:2] -= self._line_through @ self._error_modes
        about_line[1] *= self.length
        return about_line

    @cached_property
    def _error_modes(self) -> Floats:
        """Matrix (5, 5) M of the coefficients' independent errors: their covariance is M M^T."""
        # In units of the coefficients' own sigmas, which differ by orders of magnitude.
        sigma = np.sqrt(np.diag(self.covariance))
        unit = np.where(sigma > 0, sigma, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(unit, unit))
        return np.asarray(unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))

    def without_bow(self) -> "RestLine":
        """Drop the bow and its uncertainty; the line and its covariance stay."""
        covariance = np.zeros((5, 5))
        covariance[:2, :2] = self.line_covariance
        return replace(self, bow=np.zeros(3), covariance=covariance)

    @cached_property
    def _line_through(self) -> Floats:
        return _line_through(self.length)


def fit_rest_line(
    lines: Sequence[Centreline],
    calibration: Calibration,
    rig: Rig,
    of_ground: GroundErrors = NO_GROUND_ERRORS,
    *,
    rows_alike: bool = False,
) -> RestLine:
    """Fit the beam's line, and its bow where there is one, to the mean of the rest images.

    The covariance follows from the points' own scatter. With `rows_alike`, errors that follow the
    pixel grid are alike in all rows. Raises InputError where the images show too little of the
    beam.
    """
    mean = mean_points(lines, calibration, of_ground)._replace(rows_alike=rows_alike)
    points = correct_for_sag(mean.points, calibration.camera.viewpoint, rig)
    if len(points) < THRESHOLDS.min_points:
        raise InputError(
            f"the rest images show {len(points)} columns of the beam, "
            f"needed are {THRESHOLDS.min_points}"
        )
    x, y = points[:, 0] - rig.base_position[0], points[:, 1]
    bowed = fit_columns(mean, _curve(x, rig.beam.length), y)
    rest = _line_or_bow(x, y, mean, bowed, rig)
    if rest.bow_undecided:
        return rest
    beside = y - rest.y_at_clamp - rest.slope * x - rest.bow_at(x)[0]
    pattern = pattern_of(x / rest.length, beside, mean.sigma, mean.random)
    return replace(rest, pattern=pattern, noise_covariance=bowed.noise_covariance)


def _line_or_bow(x: Floats, y: Floats, mean: RestPoints, bowed: LinearFit, rig: Rig) -> RestLine:
    """Choose a line, or a bow where there is one, by what each leaves of the points (n,) [m]."""
    length = rig.beam.length
    curve = _curve(x, length)
    straight = fit_columns(mean, np.column_stack([np.ones_like(x), x]), y)
    c, s = bowed.coefficients, np.append(straight.coefficients, np.zeros(3))
    covariance = np.zeros((5, 5))
    covariance[:2, :2] = straight.covariance
    if len(x) <= MIN_BOW_POINTS:
        return _rest_line(s, covariance, length)
    # Both fits are compared by the scatter about the curve, which fits the beam in either case.
    gain = straight.chi2 - bowed.chi2
    if gain <= THRESHOLDS.bow_chi2 * bowed.scatter:
        return _hardly_bowed(bowed, straight, gain, _small_bow(rig, mean.pixel), length)
    bend = float(np.abs(curve @ (c - s)).max())
    if gain > THRESHOLDS.bow_chi2 * bowed.repeated or bend > MAX_GRID_ERROR_PX * mean.pixel:
        return _rest_line(c, bowed.covariance, length)
    # Uniform from straight to fully bowed: the second moment about zero.
    covariance += np.outer(c - s, c - s) / 3
    return replace(_rest_line(s, covariance, length), bow_undecided=True)


def _rest_line(coefficients: Floats, covariance: Floats, length: float) -> RestLine:
    """Return the line with coefficients (5,) and covariance (5, 5) of (y_at_clamp, slope, bow)."""
    y_at_clamp, slope, *_ = coefficients
    return RestLine(float(y_at_clamp), float(slope), coefficients[2:], covariance, length)


def _small_bow(rig: Rig, pixel: float) -> float:
    """Return the root mean square [m], about a line, of a bow that is within the noise."""
    of_image = SMALL_BOW_PX * pixel
    stated = rig.shape.bow_sigma * rig.beam.length * _PARABOLA
    of_lens = of_image if rig.distortion_coefficients else _LEAST_BOW_PX * pixel
    return min(of_image, math.hypot(stated, of_lens))


def _hardly_bowed(
    bowed: LinearFit, straight: LinearFit, gain: float, small: float, length: float
) -> RestLine:
    """Return the beam whose bow is within the noise, with the bow that it may have.

    Errors of the calibration as small as the noise would still move the contact of a beam that is
    hardly bent. The bow's prior is normal, with a root mean square of `small` [m] about a line; it
    is subtracted where Akaike's criterion (1974) asks for its three coefficients, whether errors
    are like noise or follow the pixel grid.
    """
    curve, line_through = _curve(_along(length), length), _line_through(length)
    relative = curve - curve[:, :2] @ line_through
    prior = 3 * relative.T @ relative / len(relative) / small**2
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
    return _rest_line(c, (covariance + covariance.T) / 2, length)


def _curve(x: Floats, length: float) -> Floats:
    """Compute the terms (n, 5) of the beam's course at rest: a line and a bow."""
    t = x / length
    return np.column_stack([np.ones_like(x), x, t**2, t**3, t**4])


def _along(length: float) -> Floats:
    """Return places (50,) [m] along the beam, over which its course is averaged."""
    return np.linspace(0.0, length, 50)


def _line_through(length: float) -> Floats:
    """Compute the least-squares line (2, 5) through each of the curve's terms along the beam."""
    curve = _curve(_along(length), length)
    return np.asarray(np.linalg.pinv(curve[:, :2]) @ curve)
