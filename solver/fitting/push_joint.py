"""Define the least-squares problem of all frames of a push.

The unknowns are, in this order, q of every frame, the clamp's pose (dx, dy, tilt), which all frames
share, and the four of the push: the contact distance at rest x0 [m], the onset's motor angle [rad],
the object's compliance [m/N] and its reach [m]. Every shape must have the object at x0, which
determines its lever. The points of a frame measure its shape and the clamp; the encoder measures
its pushing angle, which also follows from the shape.

With friction the unknowns of the grips follow, Coulomb's coefficient first, as defined in
`sliding`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import lstsq

from solver.beam_models import frictional
from solver.fitting.gauss_newton import Fit, Linearised
from solver.fitting.push_frame import POINT_COLUMNS, PushFrame
from solver.fitting.push_geometry import touch
from solver.fitting.thresholds import LIMITS
from solver.instrument.arrays import Floats
from solver.instrument.rig import Rig

BASE: Final = 3
PUSH: Final = 4
# Tolerance of levers as a fraction of the beam's length, and maximum number of Newton's steps.
_LEVER_TOLERANCE: Final = 1e-10
_MAX_STEPS: Final = 20
# Prior sigma of an object's radius, as a fraction of the beam's length: about the largest expected.
RADIUS_SIGMA: Final = 0.05
# Prior sigma of Coulomb's coefficient and of each grip: a typical coefficient of dry friction.
DRY: Final = 0.4


@dataclass(frozen=True)
class Shapes:
    """Levers and pushing angles of a push's n frames, as functions of its parameters (p,).

    `levers` (n,) [m] and `pushing_angles` (n,) [rad] have the gradients (n, p).
    """

    levers: Floats
    pushing_angles: Floats
    d_levers: Floats
    d_pushing_angles: Floats


@dataclass(frozen=True)
class Push:
    """Two or more frames of one push of a rig, with the clamp's prior `base_covariance` (3, 3).

    `grip_matrix` (n, m) maps m unknowns to the frames' grips; m is zero without friction.
    """

    frames: tuple[PushFrame, ...]
    rig: Rig
    base_covariance: Floats
    grip_matrix: Floats

    @property
    def motor_angles(self) -> Floats:
        """Encoder readings (n,) [rad]."""
        return np.array([frame.motor_angle for frame in self.frames])

    @property
    def encoder_sigma(self) -> float:
        """Sigma of the motor angle [rad]."""
        return max(self.rig.tolerances.encoder, LIMITS.min_encoder_sigma)

    @property
    def size(self) -> int:
        """Number of parameters before the unknowns of the grips."""
        return len(self.frames) + BASE + PUSH

    @property
    def friction(self) -> bool:
        """Whether the push is modelled with friction."""
        return bool(self.grip_matrix.shape[1])

    def shapes(self, parameters: Floats) -> Shapes | None:
        """Solve for the levers with the object at x0, by Newton's steps; None if none exist."""
        count, length = len(self.frames), self.rig.beam.length
        q, grip = parameters[:count], self.grip_matrix @ parameters[self.size :]
        x0, _, compliance, reach = parameters[self.size - PUSH : self.size]
        if not (q >= 0).all() or x0 <= 0:
            return None
        max_levers = 0.999 * frictional.farthest(q, grip)
        levers = np.minimum(x0, max_levers)
        for _ in range(_MAX_STEPS):
            contacts = touch(q, levers, grip, compliance, reach, self.rig.beam)
            if contacts is None:
                return None
            step = (contacts.distance - x0) / contacts.d_distance[1]
            if np.abs(step).max() < _LEVER_TOLERANCE * length:
                break
            levers = np.clip(levers - step, 0.1 * levers, max_levers)
        else:
            return None
        # Derivatives by q, (compliance, reach) and grips at constant distance: the levers follow.
        by_lever = contacts.d_distance[1]
        d_levers = self._by_all(-contacts.d_distance / by_lever)
        d_levers[:, self.size - PUSH] = 1 / by_lever
        by_angle = contacts.d_pushing_angle
        d_angles = self._by_all(by_angle) + by_angle[1][:, None] * d_levers
        return Shapes(levers, contacts.pushing_angle, d_levers, d_angles)

    def _by_all(self, by_touch: Floats) -> Floats:
        """Map a touch's gradient (5, n), except that by the levers, to all parameters (n, p)."""
        gradient = np.zeros((len(self.frames), self.size + self.grip_matrix.shape[1]))
        np.fill_diagonal(gradient, by_touch[0])
        gradient[:, self.size - 2 : self.size] = by_touch[3:].T
        gradient[:, self.size :] = by_touch[2][:, None] * self.grip_matrix
        return gradient

    def residuals(self, parameters: Floats) -> Linearised | None:
        """Compute residuals and Jacobian in sigmas; None if a shape or its push does not exist."""
        shapes = self.shapes(parameters)
        images = None if shapes is None else self._image_residuals(parameters, shapes.levers)
        if shapes is None or images is None:
            return None
        # Levers are functions of all parameters; the other unknowns of the points are parameters.
        count, image_unknowns = len(self.frames), len(self.frames) + BASE
        by_parameters = np.zeros((images[1].shape[1], len(parameters)))
        by_parameters[:image_unknowns, :image_unknowns] = np.eye(image_unknowns)
        by_parameters[image_unknowns : image_unknowns + count] = shapes.d_levers
        by_parameters[image_unknowns + count :, self.size :] = np.eye(self.grip_matrix.shape[1])
        residual, jacobian = self._push_residuals(parameters, shapes)
        return np.append(images[0], residual), np.vstack([images[1] @ by_parameters, jacobian])

    def _image_residuals(self, parameters: Floats, levers: Floats) -> Linearised | None:
        """Compute the residuals of the images: a few rows per frame, and the clamp's prior.

        The Jacobian is by q (n), the clamp, the levers (n) and the grips' unknowns. Returns None if
        a shape does not exist.
        """
        count, grip_count = len(self.frames), self.grip_matrix.shape[1]
        clamp = slice(count, count + BASE)
        grips = self.grip_matrix @ parameters[self.size :] if self.friction else [None] * count
        residuals, jacobians = [], []
        for i, frame in enumerate(self.frames):
            shape = np.array([parameters[i], levers[i]])
            rows = frame.points(shape, parameters[clamp], self.rig.beam.length, grips[i])
            if rows is None:
                return None
            by_shape = np.zeros((len(rows), 2 * count + BASE + grip_count))
            by_shape[:, i], by_shape[:, clamp.stop + i] = rows[:, 0], rows[:, 1]
            by_shape[:, clamp] = rows[:, 2:5]
            by_shape[:, 2 * count + BASE :] = np.outer(rows[:, 5], self.grip_matrix[i])
            residuals.append(rows[:, 6])
            jacobians.append(by_shape)
        prior = np.zeros((BASE, 2 * count + BASE + grip_count))
        prior[:, clamp] = np.linalg.inv(np.linalg.cholesky(self.base_covariance))
        residuals.append(prior[:, clamp] @ parameters[clamp])
        return np.concatenate(residuals), np.vstack([*jacobians, prior])

    def _push_residuals(self, parameters: Floats, shapes: Shapes) -> Linearised:
        """Compute the push's residuals: pushing angles (n), priors of object radius and grips."""
        count, grip_count, side = (
            len(self.frames),
            self.grip_matrix.shape[1],
            self.rig.deflects_towards,
        )
        onset, reach = self.size - PUSH + 1, self.size - 1
        residual = np.zeros(count + 1 + grip_count)
        jacobian = np.zeros((len(residual), len(parameters)))
        residual[:count] = shapes.pushing_angles - side * (parameters[onset] - self.motor_angles)
        jacobian[:count] = shapes.d_pushing_angles
        jacobian[:count, onset] -= side
        residual[count] = parameters[reach] - self.rig.beam.radius
        residual[count + 1 :] = parameters[self.size :]
        jacobian[count:, reach:] = np.eye(1 + grip_count)
        sigma = np.full(len(residual), self.encoder_sigma)
        sigma[count], sigma[count + 1 :] = RADIUS_SIGMA * self.rig.beam.length, DRY
        return residual / sigma, jacobian / sigma[:, None]

    def moved_by_shared_errors(self, fit: Fit) -> Floats:
        """Compute the displacement (p, k) of a fit by one sigma of each shared error."""
        parameters = fit.parameters
        shapes, joint = self.shapes(parameters), self.residuals(parameters)
        assert shapes is not None
        assert joint is not None
        count = max(frame.problem.shared_errors.shape[1] for frame in self.frames)
        shared = np.zeros((len(joint[0]), count))
        first = 0
        for i, frame in enumerate(self.frames):
            shape = np.array([parameters[i], shapes.levers[i]])
            base = parameters[len(self.frames) : len(self.frames) + BASE]
            grip = float(self.grip_matrix[i] @ parameters[self.size :]) if self.friction else None
            rows = frame.points(shape, base, self.rig.beam.length, grip)
            assert rows is not None
            shared[first : first + len(rows), : rows.shape[1] - POINT_COLUMNS] = rows[
                :, POINT_COLUMNS:
            ]
            first += len(rows)
        return np.asarray(fit.covariance @ joint[1].T @ shared)

    def consistency_chi2(self, parameters: Floats) -> tuple[float, int]:
        """Compute chi^2 and degrees of freedom of the push's own equations (Rao 1948).

        This chi^2 is the decrease if each frame had a shape of its own, to first order about the
        joint fit's `parameters`. For a single object at rest at one place, on a linear spring, it
        is chi^2-distributed; for one that moves or slips it is large, however noisy the points.
        """
        shapes, joint = self.shapes(parameters), self.residuals(parameters)
        assert shapes is not None
        assert joint is not None
        images = self._image_residuals(parameters, shapes.levers)
        assert images is not None
        (all_residuals, _), (image_residuals, jacobian) = joint, images
        scale = np.linalg.norm(jacobian, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        step = lstsq(jacobian / scale, image_residuals, lapack_driver="gelsy")[0]
        remaining = image_residuals - jacobian @ (step / scale)
        dof = len(all_residuals) - len(image_residuals) + jacobian.shape[1] - len(parameters)
        return float(all_residuals @ all_residuals - remaining @ remaining), dof
