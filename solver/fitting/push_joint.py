"""All frames of a push in one least-squares problem.

The unknowns are, in this order, (q, lever) of every frame, the clamp's pose (dx, dy, tilt), which
all frames share, and the four of the push: the contact distance at rest x0 [m], the onset's motor
angle [rad], the object's compliance [m/N] and its reach [m]. The points of a frame measure its
shape and the clamp; the encoder measures its pushing angle, which the shape tells too; and every
shape must put the object at the same x0.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import lstsq

from solver.fitting.gauss_newton import Linearised
from solver.fitting.problem import Problem
from solver.fitting.push_geometry import Touch, touch
from solver.fitting.residuals import DX, DY, LEVER, PARAMETERS, TILT, Q, point_residuals, possible
from solver.instrument.arrays import Floats
from solver.instrument.rig import Rig

BASE: Final = 3
PUSH: Final = 4
# Where the frame's own parameters stand among those of a single frame's fit.
_OWN: Final = [Q, LEVER, DX, DY, TILT]
# How far the object's point may err, in the beam's length: a few micrometres, which no image
# shows. A true equality would need another solver.
_FIXED: Final = 1e-5
# An encoder that claims to be exact errs by less than any shape tells [rad].
_LEAST_ENCODER: Final = 1e-6
# An object that a push meets is rounded by up to about this share of the beam's length.
_ROUNDING: Final = 0.05


@dataclass(frozen=True)
class Frame:
    """A bent frame: its motor angle [rad], its points, and `widening`, by how much the points'
    variances exceed what they state."""

    motor_angle: float
    problem: Problem
    widening: float

    def points(self, q: float, lever: float, base: Floats, length: float) -> Floats | None:
        """Up to six rows (Jacobian by (q, lever) and base, residual), in sigmas.

        They have the sum of squares and the gradient of all points (QR), so that a joint problem
        stays as small as the number of frames. None where the shape does not exist.
        """
        points, bounds, views, *_ = self.problem.arrays
        unit = np.array([length**2, 1 / length, 1 / length, 1 / length, 1.0])
        p = np.zeros(PARAMETERS)
        p[_OWN] = unit * [q, lever, *base]
        if not possible(p, points, bounds, views):
            return None
        rows = np.empty((TILT + 2, points.shape[1]))
        point_residuals(p, points, bounds, views, False, rows[-1], rows[:-1])
        condensed = np.asarray(np.linalg.qr(rows[[*_OWN, TILT + 1]].T, mode="r"))
        condensed[:, :5] *= unit
        return np.asarray(condensed / math.sqrt(self.widening), dtype=np.float64)


@dataclass(frozen=True)
class Push:
    """Two or more frames of one push of a rig, whose clamp is known to `base_covariance` (3, 3)."""

    frames: tuple[Frame, ...]
    rig: Rig
    base_covariance: Floats

    @property
    def motor_angles(self) -> Floats:
        """The encoder's readings (n,) [rad]."""
        return np.array([frame.motor_angle for frame in self.frames])

    @property
    def encoder_sigma(self) -> float:
        """One sigma of the motor angle [rad]."""
        return max(self.rig.tolerances.encoder, _LEAST_ENCODER)

    def residuals(self, parameters: Floats) -> Linearised | None:
        """Residuals and Jacobian in sigmas; None where a shape or its push does not exist."""
        count, length = len(self.frames), self.rig.beam.length
        base, push = 2 * count, 2 * count + BASE
        touches = self.touches(parameters)
        if touches is None:
            return None
        x0, onset, _, reach = parameters[push:]
        encoder, fixed, side = self.encoder_sigma, _FIXED * length, self.rig.deflects_towards
        size = 8 * count + BASE + 1
        residual, jacobian = np.zeros(size), np.zeros((size, len(parameters)))
        for i, (frame, at) in enumerate(zip(self.frames, touches, strict=True)):
            shape = slice(2 * i, 2 * i + 2)
            q, lever = parameters[shape]
            points = frame.points(q, lever, parameters[base:push], length)
            if points is None:
                return None
            rows, turned, placed = slice(8 * i, 8 * i + len(points)), 8 * i + 6, 8 * i + 7
            jacobian[rows, shape], jacobian[rows, base:push] = points[:, :2], points[:, 2:5]
            residual[rows] = points[:, 5]
            residual[turned] = at.pushing_angle - side * (onset - frame.motor_angle)
            jacobian[turned, shape] = at.d_pushing_angle[:2]
            jacobian[turned, push + 1] = -side
            jacobian[turned, push + 2 :] = at.d_pushing_angle[2:]
            residual[placed] = at.distance - x0
            jacobian[placed, shape] = at.d_distance[:2]
            jacobian[placed, push] = -1.0
            jacobian[placed, push + 2 :] = at.d_distance[2:]
            for row, sigma in ((turned, encoder), (placed, fixed)):
                residual[row] /= sigma
                jacobian[row] /= sigma
        known = slice(8 * count, 8 * count + BASE)
        whitening = np.linalg.inv(np.linalg.cholesky(self.base_covariance))
        residual[known], jacobian[known, base:push] = whitening @ parameters[base:push], whitening
        residual[-1] = (reach - self.rig.beam.radius) / (_ROUNDING * length)
        jacobian[-1, -1] = 1 / (_ROUNDING * length)
        return residual, jacobian

    def touches(self, parameters: Floats) -> list[Touch] | None:
        """What every frame's shape says of the push; None where one does not exist."""
        compliance, reach = parameters[-2:]
        found = []
        for q, lever in parameters[: 2 * len(self.frames)].reshape(-1, 2):
            exists = q >= 0 and lever > 0 and q * lever**2 / 2 < 1
            at = (
                touch(q, lever, compliance, reach, self.rig.beam.flexural_rigidity)
                if exists
                else None
            )
            if at is None:
                return None
            found.append(at)
        return found

    def tension(self, parameters: Floats) -> tuple[float, int]:
        """What the push costs: chi^2 and degrees of freedom of its own equations (Rao 1948).

        By how much chi^2 would fall if each frame had a shape of its own, to first order about
        the joint fit's `parameters`. A single object at rest at one place, on a linear spring,
        makes it chi^2-distributed; one that moves or slips makes it large, however noisy the
        points.
        """
        here = self.residuals(parameters)
        assert here is not None
        residual, jacobian = here
        count = len(self.frames)
        # Rows of the points and of the clamp's prior, by shapes and clamp alone.
        rows = np.append(np.arange(8 * count) % 8 < 6, [True] * BASE + [False])
        kept, free = residual[rows], jacobian[rows][:, : 2 * count + BASE]
        scale = np.linalg.norm(free, axis=0)
        step = lstsq(free / scale, kept, lapack_driver="gelsy")[0]
        left = kept - free @ (step / scale)
        return float(residual @ residual - left @ left), 2 * count + 1 - PUSH
