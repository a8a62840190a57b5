"""Uniform beam of a push, with or without friction: closed form."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from solver.beams import frictional
from solver.fitting.push_beam import LastShape, PushPrior
from solver.fitting.push_geometry import FirstTouch
from solver.fitting.values import SHAPE, shape_quantities
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig
from solver.uniform.problem import Problem
from solver.uniform.residuals import (
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

# Indices of a push frame's parameters among those of a fit without friction.
_FRAME_PARAMETERS: Final = [Q, LEVER, DX, DY, TILT]
_COLUMNS: Final = [
    SHAPE.index(name)
    for name in (
        "q",
        "lever",
        "dx",
        "dy",
        "tilt",
        "friction_ratio",
        "motor_angle",
        "rigidity",
        "scale",
    )
]


@dataclass(frozen=True)
class UniformPoints:
    """Points of a frame without outliers, and their variance inflation."""

    problem: Problem
    variance_inflation: float

    def rows(
        self, shape: Floats, base: Floats, length: float, friction_ratio: float | None
    ) -> Floats | None:
        """Compute the rows of `PushBeam.rows`; a shape (2,) is (q, lever), a base (3,) the pose."""
        shared = self.problem.shared_errors
        unit = np.array(
            [length**2, 1 / length, 1 / length, 1 / length, 1.0, 1.0, 1.0] + [1.0] * shared.shape[1]
        )
        parameters = np.array([*shape, *base]) * unit[:5]
        rows = (
            self._frictionless(parameters)
            if friction_ratio is None
            else self._frictional(parameters, friction_ratio)
        )
        if rows is None:
            return None
        condensed = np.asarray(np.linalg.qr(np.hstack([rows.T, shared]), mode="r"))[: len(rows)]
        return np.asarray(condensed * unit / math.sqrt(self.variance_inflation), dtype=np.float64)

    def _frictionless(self, parameters: Floats) -> Floats | None:
        """Compute rows (7, n): gradients by q, lever, dx, dy, tilt, friction (0); residuals."""
        points, view = self.problem.arrays.points, self.problem.arrays.viewpoint
        p = np.zeros(PARAMETERS)
        p[_FRAME_PARAMETERS] = parameters
        if not is_feasible(p, points, view):
            return None
        rows = np.zeros((TILT + 3, points.shape[1]))
        point_residuals(p, points, view, True, rows[-1], rows[:-2])
        return rows[[*_FRAME_PARAMETERS, -2, -1]]

    def _frictional(self, parameters: Floats, friction_ratio: float) -> Floats | None:
        """Compute the rows of `_frictionless` with friction, and the gradient by friction ratio."""
        q, lever, dx, dy, tilt = parameters
        if not frictional.exists(q, lever, friction_ratio):
            return None
        points = self.problem.arrays.points
        rotation = np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])
        sigmas = rotation @ points[[SIGMA_X, SIGMA_Y]]

        def weighted_misfit(position: Floats) -> tuple[Floats, Floats, Floats, Floats]:
            value, by_point, by_shape = frictional.misfit(
                position[0], position[1], q, lever, friction_ratio
            )
            sigma = (sigmas * by_point.T).sum(axis=0)
            # The weight has the sign of sigma, as in `residuals`.
            weight = 1 / np.where(np.abs(sigma) > LEAST_SIGMA, sigma, LEAST_SIGMA)
            return value * weight, by_point.T, by_shape.T, weight

        observed = rotation @ [points[X] - dx, points[Y] - dy]
        residual, *_ = weighted_misfit(observed)
        # Evaluate gradients at the points without their errors, which would bias the friction
        # ratio, as they would bias psi in `residuals`.
        x, y = foot = observed - residual * sigmas
        _, by_point, by_shape, weight = weighted_misfit(foot)
        by_tilt = by_point[0] * y - by_point[1] * x
        gradients = np.vstack([by_shape[:2], -rotation.T @ by_point, by_tilt, by_shape[2]])
        return np.vstack([gradients * weight, residual])


@dataclass(frozen=True)
class UniformPush:
    """Uniform beam of a rig, and the points of a push's n frames, as `PushBeam`.

    The place is the lever of the force about the clamp [m]. The parameters of the clamp are those
    of its pose (dx, dy, tilt), with the covariance `base_covariance` (3, 3).
    """

    frames: tuple[UniformPoints, ...]
    rig: Rig
    base_covariance: Floats

    @property
    def points(self) -> int:
        """Number of points in all frames."""
        return sum(frame.problem.points for frame in self.frames)

    @cached_property
    def prior(self) -> PushPrior:
        """The clamp's prior."""
        return PushPrior(np.zeros(3), np.linalg.inv(np.linalg.cholesky(self.base_covariance)))

    @property
    def own(self) -> Mapping[str, int]:
        """No others."""
        return {}

    def farthest(self, q: Floats, friction_ratio: Floats) -> Floats:
        """Compute the largest levers (n,) [m]."""
        return frictional.farthest(q, friction_ratio)

    def contacts(
        self, q: Floats, place: Floats, friction_ratio: Floats, beam: Floats
    ) -> frictional.Contact | None:
        """Compute the contacts (n,), with gradients (3, n)."""
        del beam  # the contact is relative to the clamp
        if not frictional.exists(q, place, friction_ratio):
            return None
        return frictional.contact(q, place, friction_ratio, self.rig.beam.radius)

    def first_touch(self, x0: float, beam: Floats) -> FirstTouch:
        """Return that of a straight beam."""
        del beam
        return FirstTouch(x0, 0.0, 0.0, np.array([[1.0], [0.0], [0.0]]))

    def rows(
        self, frame: int, q: float, place: float, friction_ratio: float | None, beam: Floats
    ) -> Floats | None:
        """Compute rows of a frame: seven columns, and those of the shared errors."""
        return self.frames[frame].rows(
            np.array([q, place]), beam, self.rig.beam.length, friction_ratio
        )

    def last_shape(
        self,
        last: Measurement,
        q: float,
        place: float,
        beam: Floats,
        friction_ratio: float | None,
        motor_angle: float,
    ) -> LastShape:
        """Compute the values of the last frame by `shape_quantities`."""
        shape = np.zeros(len(SHAPE))
        shape[_COLUMNS[:7]] = q, place, *beam, friction_ratio or 0.0, motor_angle
        values, by_shape, placement = shape_quantities(
            last, shape, clamp_fitted=True, friction_fitted=friction_ratio is not None
        )
        rigidity = self.rig.tolerances.flexural_rigidity / self.rig.beam.flexural_rigidity
        variances = np.array([rigidity**2, last.scale_sigma**2])
        return LastShape(values, by_shape[:, _COLUMNS], variances, placement)
