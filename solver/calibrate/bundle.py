"""Bundle adjustment: the lens and the poses of a board in its views, by least squares of points.

OpenCV's own result is only the start: it stops where its steps become small, up to half a per cent
off in focal length (its issue 22031), and it gives no joint covariance of intrinsics and pose.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.calibrate.board_detection import BoardDetection
from solver.calibrate.calibration import UNDETERMINED, Calibration, Stretch, determined
from solver.core.correlation import field_correlation
from solver.core.least_squares import Block, NormalEquations, Rows, minimise, normal_equations
from solver.instrument.arrays import Floats
from solver.instrument.board import Board
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert, rigid

# Error [px] of a point that weighs as much as one sigma of a prior: priors hardly pull.
_PRIOR_PX: Final = 0.02
# Step [px] of all points together after which the fit has converged. Chosen: a thousandth of a
# point's error moves no answer, and this is far less.
_STEP_PX: Final = 1e-6


class LensPrior(NamedTuple):
    """Prior of the lens: mean (k,) and sigma (k,) of its parameters, infinite where there is none.

    They are focal length, cx, cy [px], and the distortion's coefficients.
    """

    mean: Floats
    sigma: Floats


@dataclass(frozen=True)
class Bundle:
    """Points of several views of a board, by the lens and by the pose of the board in each view.

    The parameters p are those of the lens (k,), and then, of each view, rotation vector (3,) [rad]
    and shift (3,) [m] of its camera_from_board. The board's squares are taller than wide by
    `stretched`.
    """

    board: Board
    seen: Sequence[BoardDetection]
    prior: LensPrior
    stretched: float = 0.0

    @property
    def lens(self) -> int:
        """Number of the lens's parameters."""
        return len(self.prior.mean)

    @cached_property
    def points(self) -> list[Floats]:
        """Places (n, 3) [m] on the board of each view's points."""
        corners = self.board.corners() * [1.0, 1.0 + self.stretched, 1.0]
        return [corners[detection.numbers] for detection in self.seen]

    def fit(self, start: Floats) -> NormalEquations:
        """Minimise the reprojection errors [px] from `start`, with the lens's prior.

        Raises InputError if the views do not determine the camera.
        """
        mean, information = np.zeros(len(start)), np.zeros((len(start), len(start)))
        mean[: self.lens] = self.prior.mean
        information[: self.lens, : self.lens] = np.diag((_PRIOR_PX / self.prior.sigma) ** 2)
        free = np.arange(len(start))

        def system(p: Floats) -> NormalEquations:
            views = tuple(self._view(p, view) for view in range(len(self.seen)))
            return normal_equations(p, free, mean, information, views)

        minimum = minimise(system, determined(start), step_sigmas=_STEP_PX)
        if minimum is None:
            raise InputError(UNDETERMINED)
        determined(minimum.at.p)
        at: NormalEquations = minimum.at
        return at

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

    def start_from_prior(self) -> Floats:
        """Estimate the pose of the only view for a lens without distortion, that of the prior."""
        focal, cx, cy = self.prior.mean
        matrix = np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1.0]])
        _, rotation, shift = cv2.solvePnP(
            self.points[0], self.seen[0].pixels, matrix, np.zeros(5), flags=cv2.SOLVEPNP_IPPE
        )
        pose = np.vstack([rotation, shift]).ravel().astype(np.float64)
        return np.concatenate([self.prior.mean, pose])

    def calibration(self, at: NormalEquations, width: int, height: int, rig: Rig) -> Calibration:
        """Return the camera of a fit, with square pixels, and its covariance."""
        focal, cx, cy, *distortion = (float(value) for value in at.p[: self.lens])
        camera = Camera(
            width=width,
            height=height,
            fx=focal,
            fy=focal,
            cx=cx,
            cy=cy,
            camera_from_antenna=rigid(*self._pose(at.p, 0)) @ invert(rig.antenna_from_board),
            distortion=tuple(distortion),
        )
        errors = self.errors(at)
        return Calibration(
            camera, float(np.sqrt((errors**2).sum() / len(errors))), self._covariance(at)
        )

    def errors(self, at: NormalEquations) -> Floats:
        """Return the reprojection errors (n, 2) [px] of all points of a fit."""
        return np.concatenate([rows.residual for rows in at.rows]).reshape(-1, 2)

    def stretch(self, at: NormalEquations) -> Stretch:
        """Estimate a further stretch of the board by one linear step from a fit."""
        by_stretch, by_p = [], np.zeros(len(at.p))
        for view, (points, rows) in enumerate(zip(self.points, at.rows, strict=True)):
            rotation = cv2.Rodrigues(self._pose(at.p, view)[0])[0]
            by_shift = rows.jacobian[self.lens + 3 :]
            by_stretch.append(rotation[:, 1] @ by_shift * np.repeat(points[:, 1], 2))
            by_p[self._columns(view)] += rows.jacobian @ by_stretch[view]
        # Its part that no change of the camera explains.
        explained = np.linalg.solve(at.normal, by_p)
        remaining = np.concatenate(
            [
                column - rows.jacobian.T @ explained[self._columns(view)]
                for view, (column, rows) in enumerate(zip(by_stretch, at.rows, strict=True))
            ]
        )
        of_prior = explained[: self.lens] * (_PRIOR_PX / self.prior.sigma) ** 2
        information = float(remaining @ remaining + of_prior @ explained[: self.lens])
        errors = self.errors(at).ravel()
        pull = of_prior @ (at.p[: self.lens] - self.prior.mean)
        value = -float(remaining @ errors - pull) / information
        variance = self._variance(errors + value * remaining, len(at.p) + 1)
        return Stretch(value, math.sqrt(variance / information))

    def _pose(self, p: Floats, view: int) -> tuple[Floats, Floats]:
        """Return rotation vector (3,) [rad] and shift (3,) [m] of a view's camera_from_board."""
        start = self.lens + 6 * view
        return p[start : start + 3], p[start + 3 : start + 6]

    def _columns(self, view: int) -> npt.NDArray[np.int64]:
        """Return the indices (k + 6,) of the parameters of one view: lens and pose."""
        start = self.lens + 6 * view
        return np.asarray(np.r_[: self.lens, start : start + 6])

    def _view(self, p: Floats, view: int) -> Block:
        """Compute a view's reprojection errors [px], u and v in turn, by its parameters."""
        focal, cx, cy, *distortion = p[: self.lens]
        rotation, shift = self._pose(p, view)
        pixels, derivatives = cv2.projectPoints(
            self.points[view],
            rotation,
            shift,
            np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1.0]]),
            np.array(distortion or np.zeros(5)),
        )
        residual = (pixels.reshape(-1, 2) - self.seen[view].pixels).ravel().astype(np.float64)
        # OpenCV's columns: rotation, shift, fx, fy, cx, cy, distortion.
        by_focal = derivatives[:, 6] + derivatives[:, 7]
        by_lens = np.column_stack([by_focal, derivatives[:, 8 : 7 + self.lens]])
        jacobian = np.column_stack([by_lens, derivatives[:, :6]]).T
        rows = Rows(residual, np.ascontiguousarray(jacobian, np.float64))
        return Block(rows, self._columns(view), np.ones(len(residual)), float(residual @ residual))

    def _covariance(self, at: NormalEquations) -> Floats:
        """Compute the covariance of the lens and the pose of view 0, as in `Calibration`.

        It is the inverse of the normal matrix, scaled by the residuals' variance and by the number
        of neighbours on the board with a common error.
        """
        size = self.lens + 6
        inverse = np.linalg.inv(at.normal)[:size, :size]
        transform = np.eye(size)
        transform[self.lens : -3, self.lens : -3] = _rotation_jacobian(self._pose(at.p, 0)[0])
        variance = self._variance(self.errors(at).ravel(), len(at.p))
        return np.asarray(transform @ inverse @ transform.T * variance)

    def _variance(self, errors: Floats, parameters: int) -> float:
        """Compute the variance [px^2] of errors (2n,), u and v in turn, per independent point."""
        variance = float(errors @ errors) / (len(errors) - parameters)
        return variance * self._correlated_points(errors.reshape(-1, 2))

    def _correlated_points(self, errors: Floats) -> float:
        """Estimate the number of points with a common error, by autocorrelation on the board.

        The autocorrelation of errors (n, 2) is integrated along rows and columns: crossings on one
        line share the error of that line across it. The larger value of u and v counts.
        """
        on_board = np.full((len(self.seen), self.board.rows * self.board.columns, 2), np.nan)
        boundaries = np.cumsum([len(detection) for detection in self.seen])[:-1]
        for view, errors_in_view in enumerate(np.split(errors, boundaries)):
            on_board[view, self.seen[view].numbers] = errors_in_view
        grid = on_board.reshape(-1, self.board.rows, self.board.columns, 2)
        return max(
            field_correlation(grid[..., i], 1) * field_correlation(grid[..., i], 2) for i in (0, 1)
        )


def _rotation_jacobian(rotation: Floats) -> Floats:
    """Compute the map (3, 3) from a rotation vector's (3,) [rad] change to the small turn."""
    matrix, derivatives = cv2.Rodrigues(rotation)
    rotations = [derivative.reshape(3, 3) @ matrix.T for derivative in derivatives]
    return np.array([[rotated[2, 1], rotated[0, 2], rotated[1, 0]] for rotated in rotations]).T
