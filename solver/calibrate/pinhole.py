"""Pinhole calibration with distortion from several views: Zhang (2000), then bundle adjustment.

OpenCV's own result is only the start: it stops where its steps become small, up to half a per cent
off in focal length (its issue 22031), and it gives no joint covariance of intrinsics and pose.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

import cv2
import numpy as np
from scipy.optimize import least_squares

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.calibration import Calibration, Stretch, determined
from solver.calibrate.thresholds import THRESHOLDS
from solver.core.correlation import field_correlation
from solver.instrument.arrays import Floats
from solver.instrument.board import Board
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert, rigid

_TOLERANCE: Final = 1e-14
# Prior of the coefficients, which are of the order of one: a coefficient of 1 has the weight of a
# corner's error of this size. Without it a rational lens's k1 and k4 may diverge together, nearly
# cancelling each other.
_PRIOR_PX: Final = 0.02
# Steps of the board's stretch, each with a new fit, and their largest size, up to which they are
# nearly linear. Chosen.
_STRETCH_STEPS, _LARGEST_STRETCH_STEP = 5, 0.02


def pinhole(seen: Sequence[BoardDetection], width: int, height: int, rig: Rig) -> Calibration:
    """Calibrate a camera with square pixels from several views of the rig's board, view 0 first.

    Every point has the same weight; the least squares run in float64 to 14 digits. Raises
    InputError if there are fewer than three views.
    """
    if len(seen) < THRESHOLDS.min_views:
        raise InputError(
            f"{len(seen)} calibration views show enough of the board, needed are "
            f"{THRESHOLDS.min_views}; a single view works with 0 camera.distortion_coefficients, "
            "as in the paper"
        )
    bundle, fit = _adjust_bundle(rig, seen, width, height)
    inliers = _without_outliers(seen, fit.fun)
    if sum(map(len, inliers)) < sum(map(len, seen)):
        bundle, fit = _adjust_bundle(rig, inliers, width, height)
    focal, cx, cy, *remaining = fit.x
    distortion = tuple(remaining[: rig.distortion_coefficients])
    rotation, shift = bundle.pose(fit.x, 0)
    camera = Camera(
        width=width,
        height=height,
        fx=float(focal),
        fy=float(focal),
        cx=float(cx),
        cy=float(cy),
        camera_from_antenna=rigid(rotation, shift) @ invert(rig.antenna_from_board),
        distortion=distortion,
    )
    point_count = sum(map(len, bundle.seen))
    residuals = fit.fun[: 2 * point_count]
    return Calibration(
        camera,
        float(np.sqrt(residuals @ residuals / point_count)),
        bundle.covariance(fit),
        stretch=_stretch(bundle, fit, width, height),
    )


def _stretch(bundle: "Bundle", fit: Any, width: int, height: int) -> Stretch:
    """Estimate how much taller than wide the board is printed, which the model leaves out.

    The first step is linear; where it is significant, the camera is fitted anew for each next step.
    """
    step, total = bundle.stretch(fit), 0.0
    for _ in range(_STRETCH_STEPS):
        if not step.is_significant:
            break
        total += min(max(step.value, -_LARGEST_STRETCH_STEP), _LARGEST_STRETCH_STEP)
        stretched = bundle.stretched(total)
        step = stretched.stretch(stretched.fit(stretched.start(width, height)))
    return Stretch(total + step.value, step.sigma)


def _adjust_bundle(
    rig: Rig, detections: Sequence[BoardDetection], width: int, height: int
) -> tuple["Bundle", Any]:
    """Run the bundle adjustment; return the bundle and the least-squares result.

    Raises InputError if the views do not determine the camera.
    """
    bundle = Bundle(rig.board, detections, rig.distortion_coefficients)
    fit = bundle.fit(determined(bundle.start(width, height)))
    determined(fit.x)
    return bundle, fit


def _without_outliers(
    detections: Sequence[BoardDetection], residuals: Floats
) -> list[BoardDetection]:
    """Remove points whose error exceeds THRESHOLDS.outlier_ratio times the median."""
    total = sum(map(len, detections))
    errors = np.linalg.norm(residuals[: 2 * total].reshape(-1, 2), axis=1)
    # At least a hundredth of a pixel: points without noise err by rounding alone.
    inlier = errors <= THRESHOLDS.outlier_ratio * max(float(np.median(errors)), 0.01)
    masks = np.split(inlier, np.cumsum([len(detection) for detection in detections])[:-1])
    return [
        BoardDetection(detection.numbers[mask], detection.pixels[mask])
        for detection, mask in zip(detections, masks, strict=True)
    ]


class Bundle:
    """Residuals of all views' points, by focal length, principal point, distortion and poses."""

    def __init__(self, board: Board, seen: Sequence[BoardDetection], coefficients: int) -> None:
        corners = board.corners()
        self.board, self.seen, self.lens = board, seen, 3 + coefficients
        self.points = [corners[detection.numbers] for detection in seen]

    def fit(self, start: Floats) -> Any:
        """Minimise the residuals from `start`; return the least-squares result."""
        return least_squares(
            self.residuals,
            start,
            self.jacobian,
            method="lm",
            x_scale="jac",
            xtol=_TOLERANCE,
            ftol=_TOLERANCE,
            gtol=_TOLERANCE,
        )

    def stretched(self, stretch: float) -> "Bundle":
        """Return the bundle of a board whose squares are taller than wide by `stretch`."""
        bundle = Bundle(self.board, self.seen, self.lens - 3)
        bundle.points = [points * [1.0, 1.0 + stretch, 1.0] for points in bundle.points]
        return bundle

    def stretch(self, found: Any) -> Stretch:
        """Estimate a further stretch of the board by one linear step from a fit."""
        column = np.zeros(len(found.fun))
        row = 0
        for view, points in enumerate(self.points):
            derivatives = self._projected(found.x, view)[1]
            rotation = cv2.Rodrigues(self.pose(found.x, view)[0])[0]
            up = derivatives[:, 3:6] @ rotation[:, 1]
            column[row : row + 2 * len(points)] = up * np.repeat(points[:, 1], 2)
            row += 2 * len(points)
        # What the camera cannot imitate of it.
        column -= found.jac @ np.linalg.lstsq(found.jac, column, rcond=None)[0]
        information = float(column @ column)
        value = -float(column @ found.fun) / information
        left = found.fun + value * column
        variance = self._variance(left[: 2 * sum(map(len, self.seen))], len(found.x) + 1)
        return Stretch(value, math.sqrt(variance / information))

    def start(self, width: int, height: int) -> Floats:
        """Compute OpenCV's estimate for a lens without distortion, or with k1 and k2 only."""
        # Free coefficients of a higher order would be correlated with the focal length.
        flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3
        if self.lens == 3:
            flags |= cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2
        matrix = np.array([[width, 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1.0]])
        _, matrix, lens, rotations, shifts = cv2.calibrateCamera(
            [points.astype(np.float32) for points in self.points],
            [detection.pixels.astype(np.float32) for detection in self.seen],
            (width, height),
            matrix,
            np.zeros(5),
            flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
        )
        intrinsics = [matrix[0, 0], matrix[0, 2], matrix[1, 2], *lens.ravel(), 0.0, 0.0, 0.0]
        poses = [np.vstack(pose).ravel() for pose in zip(rotations, shifts, strict=True)]
        return np.concatenate([intrinsics[: self.lens], *poses])

    def posed(self, lens: Floats) -> Floats:
        """Estimate rotation vector and shift (6,) of view 0 for a lens (focal length, cx, cy)."""
        focal, cx, cy = lens
        matrix = np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1.0]])
        _, rotation, shift = cv2.solvePnP(
            self.points[0], self.seen[0].pixels, matrix, np.zeros(5), flags=cv2.SOLVEPNP_IPPE
        )
        return np.vstack([rotation, shift]).ravel().astype(np.float64)

    def pose(self, values: Floats, view: int) -> tuple[Floats, Floats]:
        """Return rotation vector (3,) [rad] and shift (3,) [m] of a view's camera_from_board."""
        start = self.lens + 6 * view
        return values[start : start + 3], values[start + 3 : start + 6]

    def residuals(self, values: Floats) -> Floats:
        """Compute the reprojection errors [px], u and v in turn, then the coefficients' prior."""
        projected = [self._projected(values, view)[0] for view in range(len(self.seen))]
        measured = np.vstack([detection.pixels for detection in self.seen])
        prior = _PRIOR_PX * values[3 : self.lens]
        return np.concatenate([(np.vstack(projected) - measured).ravel(), prior])

    def jacobian(self, values: Floats) -> Floats:
        """Compute d(residuals)/d(values)."""
        data_rows, coefficients = 2 * sum(map(len, self.seen)), self.lens - 3
        jacobian = np.zeros((data_rows + coefficients, len(values)))
        jacobian[data_rows:, 3 : self.lens] = _PRIOR_PX * np.eye(coefficients)
        row = 0
        for view, detection in enumerate(self.seen):
            # OpenCV's columns: rotation, shift, fx, fy, cx, cy, distortion.
            derivatives = self._projected(values, view)[1]
            block, column = jacobian[row : row + 2 * len(detection)], self.lens + 6 * view
            block[:, 0] = derivatives[:, 6] + derivatives[:, 7]
            block[:, 1 : self.lens] = derivatives[:, 8 : 7 + self.lens]
            block[:, column : column + 6] = derivatives[:, :6]
            row += 2 * len(detection)
        return jacobian

    def _projected(self, values: Floats, view: int) -> tuple[Floats, Floats]:
        focal, cx, cy, *lens = values[: self.lens]
        matrix = np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1.0]])
        coefficients = np.array(lens) if lens else np.zeros(5)
        rotation, shift = self.pose(values, view)
        pixels, derivatives = cv2.projectPoints(
            self.points[view], rotation, shift, matrix, coefficients
        )
        return np.asarray(pixels, np.float64).reshape(-1, 2), np.asarray(derivatives, np.float64)

    def covariance(self, found: Any) -> Floats:
        """Compute the covariance of the lens and the pose of view 0, as in `Calibration`.

        It is the inverse of the normal matrix, scaled by the residuals' variance and by the number
        of neighbours on the board with a common error.
        """
        residuals = found.fun[: 2 * sum(map(len, self.seen))]
        variance = self._variance(residuals, len(found.x))
        size = self.lens + 6
        inverse = np.linalg.inv(found.jac.T @ found.jac)[:size, :size]
        transform = np.eye(size)
        transform[self.lens : -3, self.lens : -3] = _rotation_jacobian(self.pose(found.x, 0)[0])
        return np.asarray(transform @ inverse @ transform.T * variance)

    def _variance(self, residuals: Floats, parameters: int) -> float:
        """Compute the residuals' variance [px^2] per independent point."""
        variance = float(residuals @ residuals) / (len(residuals) - parameters)
        return variance * self._correlated_points(residuals)

    def _correlated_points(self, residuals: Floats) -> float:
        """Estimate the number of points with a common error, by autocorrelation on the board.

        The autocorrelation is integrated along rows and columns: crossings on one line share the
        error of that line across it. The larger value of u and v counts.
        """
        shape = (len(self.seen), self.board.rows * self.board.columns, 2)
        errors = np.full(shape, np.nan)
        boundaries = np.cumsum([len(detection) for detection in self.seen])[:-1]
        for view, errors_in_view in enumerate(np.split(residuals.reshape(-1, 2), boundaries)):
            errors[view, self.seen[view].numbers] = errors_in_view
        grid = errors.reshape(-1, self.board.rows, self.board.columns, 2)
        return max(
            field_correlation(grid[..., i], 1) * field_correlation(grid[..., i], 2) for i in (0, 1)
        )


def _rotation_jacobian(rotation: Floats) -> Floats:
    """Compute the map (3, 3) from a rotation vector's (3,) [rad] change to the small turn."""
    matrix, derivatives = cv2.Rodrigues(rotation)
    rotations = [derivative.reshape(3, 3) @ matrix.T for derivative in derivatives]
    return np.array([[rotated[2, 1], rotated[0, 2], rotated[1, 0]] for rotated in rotations]).T
