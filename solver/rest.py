"""The beam before contact: where it is clamped, how it lies, and its bow.

What the camera's calibration, the light's side and the mounting leave wrong is the same before
contact and after it; the rest images show it, and it is taken off.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.calibrate import Calibration
from solver.centreline import Centreline
from solver.fitting.correlation import correlation_length
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig
from solver.plane import on_plane
from solver.sag import raised

LEAST_POINTS = 10
# A beam is bowed if straight it would leave this much more chi^2, for three coefficients.
BOWED_CHI2 = 30.0


@dataclass(frozen=True)
class Rest:
    """The beam before contact, on plane C: y = y_at_clamp + slope x + bow(x), x from the clamp [m].

    `bow` (3,) are the coefficients of x^2, x^3, x^4 in units of the beam's `length` [m]; they are
    zero for a beam that is straight within the noise. `covariance` (5, 5) is that of
    (y_at_clamp, slope, bow).
    """

    y_at_clamp: float
    slope: float
    bow: Floats
    covariance: Floats
    length: float

    @property
    def straight(self) -> bool:
        """Whether no bow was found."""
        return not self.bow.any()

    @property
    def line_covariance(self) -> Floats:
        """Covariance (2, 2) of the line through the whole curve's error: offset at x = 0, slope.

        Slope and bow are known much better together than each by itself.
        """
        return np.asarray(self._line_through @ self.covariance @ self._line_through.T)

    def bow_at(self, x: Floats) -> tuple[Floats, Floats]:
        """The bow (n,) [m] at distances x (n,) [m] from the clamp, and its sigma about a line."""
        here, line_here = self._basis(x)
        off = here - line_here @ self._line_through
        variance = np.einsum("ni,ij,nj->n", off, self.covariance, off)
        return np.asarray(here[:, 2:] @ self.bow), np.sqrt(np.maximum(variance, 0.0))

    @cached_property
    def _line_through(self) -> Floats:
        """The line (2, 5) through each of the curve's terms."""
        curve, line = self._basis(np.linspace(0.0, self.length, 50))
        return np.asarray(np.linalg.pinv(line) @ curve)

    def _basis(self, x: Floats) -> tuple[Floats, Floats]:
        line = np.column_stack([np.ones_like(x), x])
        return np.column_stack([line, _bow_powers(x / self.length)]), line


def learn_rest(lines: Sequence[Centreline], calibration: Calibration, rig: Rig) -> Rest:
    """The curve through the mean of the rest images; its covariance from the points' own scatter.

    The images are averaged place by place first: a centre's error on the pixel grid is the same in
    all of them, so four images do not know the beam twice as well as one. Raises InputError where
    they show too little of the beam.
    """
    points, sigma = _mean_line(lines, calibration)
    points = raised(points, calibration.camera.viewpoint, rig)
    if len(points) < LEAST_POINTS:
        raise InputError(
            f"the rest images show {len(points)} columns of the beam, needed are {LEAST_POINTS}"
        )
    length = rig.beam.length
    x, y = points[:, 0] - rig.base_position[0], points[:, 1]
    line = np.column_stack([np.ones_like(x), x])
    curve = np.column_stack([line, _bow_powers(x / length)])
    flat, flat_covariance, flat_chi2 = _least_squares(line, y, sigma)
    bent, bent_covariance, bent_chi2 = _least_squares(curve, y, sigma)
    # A covariance computed for independent errors is too small where neighbours err alike.
    if len(points) > 50 and flat_chi2 - bent_chi2 > BOWED_CHI2:
        return Rest(float(bent[0]), float(bent[1]), bent[2:], bent_covariance, length)
    covariance = np.zeros((5, 5))
    covariance[:2, :2] = flat_covariance
    return Rest(float(flat[0]), float(flat[1]), np.zeros(3), covariance, length)


def _bow_powers(place: Floats) -> Floats:
    return np.column_stack([place**2, place**3, place**4])


def _least_squares(design: Floats, y: Floats, sigma: Floats) -> tuple[Floats, Floats, float]:
    """Coefficients, their widened covariance, and chi^2 in units of its own scatter."""
    whitened = design / sigma[:, None]
    inverse: Floats = np.linalg.pinv(whitened.T @ whitened, hermitian=True).astype(np.float64)
    coefficients = inverse @ (whitened.T @ (y / sigma))
    residual = (y - design @ coefficients) / sigma
    widening = max(float(np.mean(residual**2)), 1e-12) * correlation_length(residual)
    robust = (1.4826 * float(np.median(np.abs(residual)))) ** 2 + 1e-12
    return coefficients, inverse * widening, float(residual @ residual) / max(robust, 1.0)


def _mean_line(lines: Sequence[Centreline], calibration: Calibration) -> tuple[Floats, Floats]:
    """Points (n, 2) on C [m], each the mean over the images, and their sigma (n,) along y [m]."""
    pixels = np.vstack([line.points for line in lines])
    if not len(pixels):
        return np.empty((0, 2)), np.empty(0)
    directions = np.vstack([line.directions for line in lines])
    sigma = np.concatenate([line.sigma for line in lines])
    upright = directions[:, 1] != 0
    # Columns count from 0 up, rows down from -1: one number for every place that is read.
    key = np.where(upright, pixels[:, 0], -1 - pixels[:, 1])
    _, first, place, count = np.unique(
        key, return_index=True, return_inverse=True, return_counts=True
    )
    mean = np.column_stack([np.bincount(place, pixels[:, i]) / count for i in (0, 1)])
    mean_sigma = np.bincount(place, sigma) / count
    points, vectors = on_plane(calibration.camera, mean, directions[first] * mean_sigma[:, None])
    # Measured aslant, a point errs across the beam by the part that is not along it.
    order = np.argsort(points[:, 0])
    tilt = math.atan(np.polyfit(points[:, 0], points[:, 1], 1)[0]) if len(points) > 2 else 0.0
    across = np.abs(vectors @ [-math.sin(tilt), math.cos(tilt)]) / math.cos(tilt)
    return points[order], np.maximum(across[order], 1e-12)
