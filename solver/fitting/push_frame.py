"""Condense one frame of a push, with or without friction, to a few rows of residuals."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.beam_models import frictional
from solver.fitting.problem import Problem
from solver.fitting.residuals import (
    DX,
    DY,
    LEAST_SIGMA,
    LEVER,
    PARAMETERS,
    SIGMA_X,
    SIGMA_Y,
    TILT,
    Q,
    X,
    Y,
    is_feasible,
    point_residuals,
)
from solver.instrument.arrays import Floats

# Columns of a frame before its shared errors: five gradients, the grip, the residual.
POINT_COLUMNS: Final = 7
# Indices of a push frame's parameters among those of a fit without friction.
_FRAME_PARAMETERS: Final = [Q, LEVER, DX, DY, TILT]


@dataclass(frozen=True)
class PushFrame:
    """Bent frame: motor angle [rad], points, and their variance inflation.

    `begins` is True if the beam was free before.
    """

    motor_angle: float
    problem: Problem
    variance_inflation: float
    begins: bool = False

    def points(
        self, shape: Floats, base: Floats, length: float, grip: float | None
    ) -> Floats | None:
        """Compute up to seven rows: Jacobian by (q, lever), base and grip, residual; in sigmas.

        They have the sum of squares and the gradient of all points (QR), so that the size of a
        joint problem depends only on the number of frames. The errors that all points share follow
        in k more columns. Returns None if the shape does not exist.
        """
        shared = self.problem.shared_errors
        unit = np.array(
            [length**2, 1 / length, 1 / length, 1 / length, 1.0, 1.0, 1.0] + [1.0] * shared.shape[1]
        )
        parameters = np.array([*shape, *base]) * unit[:5]
        rows = (
            self._frictionless(parameters) if grip is None else self._frictional(parameters, grip)
        )
        if rows is None:
            return None
        condensed = np.asarray(np.linalg.qr(np.hstack([rows.T, shared]), mode="r"))[: len(rows)]
        return np.asarray(condensed * unit / math.sqrt(self.variance_inflation), dtype=np.float64)

    def _frictionless(self, parameters: Floats) -> Floats | None:
        """Compute rows (7, n): gradients by (q, lever, dx, dy, tilt), zero by grip, residuals."""
        points, bounds, views, *_ = self.problem.arrays
        p = np.zeros(PARAMETERS)
        p[_FRAME_PARAMETERS] = parameters
        if not is_feasible(p, points, bounds, views):
            return None
        rows = np.zeros((TILT + 3, points.shape[1]))
        point_residuals(p, points, bounds, views, True, rows[-1], rows[:-2])
        return rows[[*_FRAME_PARAMETERS, -2, -1]]

    def _frictional(self, parameters: Floats, grip: float) -> Floats | None:
        """Compute the rows of `_frictionless` with friction, including the gradient by grip."""
        q, lever, dx, dy, tilt = parameters
        if not frictional.exists(q, lever, grip):
            return None
        points = self.problem.arrays[0]
        rotation = np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])
        sigmas = rotation @ points[[SIGMA_X, SIGMA_Y]]

        def weighted_misfit(position: Floats) -> tuple[Floats, Floats, Floats, Floats]:
            value, by_point, by_shape = frictional.misfit(position[0], position[1], q, lever, grip)
            sigma = (sigmas * by_point.T).sum(axis=0)
            # The weight has the sign of sigma, as in `residuals`.
            weight = 1 / np.where(np.abs(sigma) > LEAST_SIGMA, sigma, LEAST_SIGMA)
            return value * weight, by_point.T, by_shape.T, weight

        observed = rotation @ [points[X] - dx, points[Y] - dy]
        residual, *_ = weighted_misfit(observed)
        # Evaluate gradients at the points without their errors, which would bias the grip, as they
        # would bias psi in `residuals`.
        x, y = foot = observed - residual * sigmas
        _, by_point, by_shape, weight = weighted_misfit(foot)
        by_tilt = by_point[0] * y - by_point[1] * x
        gradients = np.vstack([by_shape[:2], -rotation.T @ by_point, by_tilt, by_shape[2]])
        return np.vstack([gradients * weight, residual])
