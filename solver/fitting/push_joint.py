"""Define the least-squares problem of all frames of a push.

The unknowns are, in this order, q of every frame, the parameters of clamp and beam, which all
frames share, and the four of the push: the contact distance at rest x0 [m], the onset's motor
angle [rad], the object's compliance [m/N] and its reach [m]. Every shape must have the object at
x0, which determines its place. The points of a frame measure its shape and the clamp; the encoder
measures its pushing angle, which also follows from the shape.

With friction the unknowns of the friction ratios follow, Coulomb's coefficient first, as defined in
`sliding`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import lstsq

from solver.core.least_squares import Fit, Rows, fit_rows
from solver.core.thresholds import THRESHOLDS
from solver.fitting.push_beam import PushBeam
from solver.fitting.push_geometry import about_axis, first_about_axis, touch
from solver.instrument.arrays import Floats
from solver.instrument.rig import Rig

PUSH: Final = 4
# Tolerance of places as a fraction of the beam's length, and maximum number of Newton's steps.
_PLACE_TOLERANCE: Final = 1e-10
_MAX_STEPS: Final = 20
# Gradients of a touch by the clamp's offset: those by compliance, reach and x0 are the last ones.
_OFFSET: Final = slice(-5, -3)
# Prior sigma of an object's radius, as a fraction of the beam's length: about the largest expected.
RADIUS_SIGMA: Final = 0.05
# Prior sigma of Coulomb's coefficient and of each friction ratio: a typical coefficient of dry
# friction.
FRICTION_PRIOR_SIGMA: Final = 0.4


class PushFrame(NamedTuple):
    """Bent frame: motor angle [rad], and whether the beam was free before."""

    motor_angle: float
    begins: bool = False


class Shapes(NamedTuple):
    """Places and pushing angles of a push's n frames, as functions of its parameters (p,).

    `places` (n,) [m] and `pushing_angles` (n,) [rad] have the gradients (n, p), and those by the
    clamp's offset from the motor's axis (n, 2).
    """

    places: Floats
    pushing_angles: Floats
    d_places: Floats
    d_pushing_angles: Floats
    places_by_offset: Floats
    angles_by_offset: Floats


@dataclass(frozen=True)
class Push:
    """Two or more frames of one push of a rig, with the shapes of its beam.

    `ratio_matrix` (n, m) maps m unknowns to the frames' friction ratios, which have the prior sigma
    `friction_sigma`; m is zero without friction. `offset` (2,) [m] is the clamp's position relative
    to the motor's axis in the frame of the beam at rest, `offset_covariance` (2, 2) its covariance.
    """

    frames: tuple[PushFrame, ...]
    rig: Rig
    beam: PushBeam
    ratio_matrix: Floats
    friction_sigma: float = FRICTION_PRIOR_SIGMA
    offset: Floats = field(default_factory=lambda: np.zeros(2))
    offset_covariance: Floats = field(default_factory=lambda: np.zeros((2, 2)))

    @property
    def motor_angles(self) -> Floats:
        """Encoder readings (n,) [rad]."""
        return np.array([frame.motor_angle for frame in self.frames])

    @property
    def encoder_sigma(self) -> float:
        """Sigma of the motor angle [rad]."""
        return max(self.rig.tolerances.encoder, THRESHOLDS.min_encoder_sigma)

    @property
    def base(self) -> slice:
        """Indices of the parameters of clamp and beam."""
        return slice(len(self.frames), len(self.frames) + len(self.beam.prior.mean))

    @property
    def size(self) -> int:
        """Number of parameters before the unknowns of the friction ratios."""
        return int(self.base.stop) + PUSH

    @property
    def friction(self) -> bool:
        """Whether the push is modelled with friction."""
        return bool(self.ratio_matrix.shape[1])

    def fit(self, start: Floats) -> "PushFit":
        """Fit from a start (p,), whose shapes exist."""
        evaluated: list[tuple[Floats, PushAt]] = []

        def rows(parameters: Floats) -> Rows | None:
            near = None
            if evaluated:
                before, at = evaluated[-1]
                near = at.shapes.places + at.shapes.d_places @ (parameters - before)
            found = self.at(parameters, near)
            if found is None:
                return None
            evaluated.append((parameters, found))
            return found.joint

        fit = fit_rows(rows, start)
        # The last evaluation may have been of a step that was not taken.
        at = next(at for parameters, at in evaluated if parameters is fit.parameters)
        return PushFit(fit, at)

    def shapes(self, parameters: Floats, near: Floats | None = None) -> Shapes | None:
        """Solve for the places with the object at x0; None if Newton's steps do not converge.

        They begin at places `near` (n,) the solution, and where these fail, at x0.
        """
        found = None if near is None else self._shapes_from(parameters, near)
        return found or self._shapes_from(parameters, None)

    def _shapes_from(self, parameters: Floats, near: Floats | None) -> Shapes | None:
        count, length = len(self.frames), self.rig.beam.length
        q, friction_ratio = parameters[:count], self.ratio_matrix @ parameters[self.size :]
        x0, _, compliance, reach = parameters[self.size - PUSH : self.size]
        if not (q >= 0).all() or x0 <= 0:
            return None
        beam, rigidity = parameters[self.base], self.rig.beam.flexural_rigidity
        first = first_about_axis(self.beam.first_touch(x0, beam), self.offset)
        max_place = self.beam.farthest
        places = np.full(count, x0) if near is None else near
        places = np.clip(places, 0.1 * x0, max_place)
        for _ in range(_MAX_STEPS):
            contacts = self.beam.contacts(q, places, friction_ratio, beam)
            if contacts is None:
                return None
            touches = touch(about_axis(contacts, self.offset), first, compliance, reach, rigidity)
            if touches is None:
                return None
            step = touches.excess / touches.d_excess[1]
            if np.abs(step).max() < _PLACE_TOLERANCE * length:
                break
            places = np.clip(places - step, 0.1 * places, max_place)
        else:
            return None
        # Derivatives by all but the places at constant excess, which is zero: the places follow.
        by_place = touches.d_excess[1]
        place_by = -touches.d_excess / by_place
        angle_by = touches.d_pushing_angle
        angle_by_place = angle_by[1][:, None]
        d_places, by_offset = self._by_all(place_by), place_by[_OFFSET].T
        return Shapes(
            places,
            touches.pushing_angle,
            d_places,
            self._by_all(angle_by) + angle_by_place * d_places,
            by_offset,
            angle_by[_OFFSET].T + angle_by_place * by_offset,
        )

    def _by_all(self, by_touch: Floats) -> Floats:
        """Map a touch's gradient (k, n), except that by the places, to all parameters (n, p)."""
        gradient = np.zeros((len(self.frames), self.size + self.ratio_matrix.shape[1]))
        np.fill_diagonal(gradient, by_touch[0])
        gradient[:, self.size :] = by_touch[2][:, None] * self.ratio_matrix
        by_beam, (by_compliance, by_reach, by_x0) = by_touch[3 : _OFFSET.start], by_touch[-3:]
        gradient[:, self.base.start : self.base.start + len(by_beam)] = by_beam.T
        x0 = self.base.stop
        gradient[:, x0], gradient[:, x0 + 2], gradient[:, x0 + 3] = by_x0, by_compliance, by_reach
        return gradient

    def residuals(self, parameters: Floats) -> Rows | None:
        """Compute residuals and Jacobian in sigmas; None if a shape or its push does not exist."""
        at = self.at(parameters)
        return None if at is None else at.joint

    def at(self, parameters: Floats, near: Floats | None = None) -> "PushAt | None":
        """Compute shapes and residuals; None if a shape or its push does not exist.

        `near` is that of `shapes`.
        """
        shapes = self.shapes(parameters, near)
        if shapes is None:
            return None
        ratios, base = self.ratio_matrix @ parameters[self.size :], parameters[self.base]
        frames = [
            self.beam.rows(i, parameters[i], shapes.places[i], ratios[i], base)
            for i in range(len(self.frames))
        ]
        present = [rows for rows in frames if rows is not None]
        if len(present) < len(frames):
            return None
        images = self._images(parameters, present)
        # Places are functions of all parameters; the other unknowns of the points are parameters.
        count, image_unknowns = len(self.frames), self.base.stop
        by_parameters = np.zeros((len(parameters), len(images.jacobian)))
        by_parameters[:image_unknowns, :image_unknowns] = np.eye(image_unknowns)
        by_parameters[:, image_unknowns : image_unknowns + count] = shapes.d_places.T
        by_parameters[self.size :, image_unknowns + count :] = np.eye(self.ratio_matrix.shape[1])
        residual, jacobian = self._push_residuals(parameters, shapes)
        joint = Rows(
            np.append(images.residual, residual),
            np.hstack([by_parameters @ images.jacobian, jacobian]),
        )
        return PushAt(self, shapes, images, joint)

    def _images(self, parameters: Floats, frames: Sequence[Floats]) -> Rows:
        """Return the residuals of the images: a few rows of each of the `frames`, and the prior.

        The Jacobian is by q (n), clamp and beam, the places (n) and the friction ratios' unknowns.
        """
        count, size = len(self.frames), self.base.stop
        base, prior = size - count, self.beam.prior
        ends = np.cumsum([len(rows) for rows in frames])
        residual = np.empty(ends[-1] + len(prior.mean))
        jacobian = np.zeros((size + count + self.ratio_matrix.shape[1], len(residual)))
        for i, (rows, end) in enumerate(zip(frames, ends, strict=True)):
            part = slice(end - len(rows), end)
            jacobian[i, part], jacobian[size + i, part] = rows[:, 0], rows[:, 1]
            jacobian[self.base, part] = rows[:, 2 : 2 + base].T
            jacobian[size + count :, part] = np.outer(self.ratio_matrix[i], rows[:, 2 + base])
            residual[part] = rows[:, 3 + base]
        jacobian[self.base, ends[-1] :] = prior.root.T
        residual[ends[-1] :] = prior.root @ (parameters[self.base] - prior.mean)
        return Rows(residual, jacobian)

    def _push_residuals(self, parameters: Floats, shapes: Shapes) -> Rows:
        """Compute the push's residuals: pushing angles (n), priors of radius and friction."""
        count, ratio_count, side = (
            len(self.frames),
            self.ratio_matrix.shape[1],
            self.rig.deflects_towards,
        )
        onset, reach = self.size - PUSH + 1, self.size - 1
        residual = np.zeros(count + 1 + ratio_count)
        jacobian = np.zeros((len(residual), len(parameters)))
        residual[:count] = shapes.pushing_angles - side * (parameters[onset] - self.motor_angles)
        jacobian[:count] = shapes.d_pushing_angles
        jacobian[:count, onset] -= side
        residual[count] = parameters[reach] - self.rig.beam.radius
        residual[count + 1 :] = parameters[self.size :]
        jacobian[count:, reach:] = np.eye(1 + ratio_count)
        sigma = np.full(len(residual), self.encoder_sigma)
        sigma[count] = RADIUS_SIGMA * self.rig.beam.length
        sigma[count + 1 :] = self.friction_sigma
        return Rows(residual / sigma, (jacobian / sigma[:, None]).T)


class PushFit(NamedTuple):
    """Fit of a push, and the push at its parameters."""

    fit: Fit
    at: "PushAt"


class PushAt(NamedTuple):
    """A push at some parameters (p,): its shapes, and residuals with Jacobian in sigmas.

    `images` are the rows of all frames, as `PushBeam.rows`, with the prior; `joint` those of the
    push as well.
    """

    push: Push
    shapes: Shapes
    images: Rows
    joint: Rows

    def moved_by_offset(self, covariance: Floats) -> Floats:
        """Compute the displacement (p, 2) of a fit by one sigma each of the clamp's offset."""
        push, images, shapes = self.push, self.images, self.shapes
        count, size, angles = len(push.frames), push.base.stop, len(images.residual)
        by_offset = np.zeros((len(self.joint.residual), 2))
        by_offset[:angles] = images.jacobian[size : size + count].T @ shapes.places_by_offset
        by_offset[angles : angles + count] = shapes.angles_by_offset / push.encoder_sigma
        values, vectors = np.linalg.eigh(push.offset_covariance)
        sigmas = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(covariance @ self.joint.jacobian @ by_offset @ sigmas)

    def consistency_chi2(self) -> tuple[float, int]:
        """Compute chi^2 and degrees of freedom of the push's own equations (Rao 1948).

        This chi^2 is the decrease if each frame had a shape of its own, to first order about the
        joint fit's parameters. For a single object at rest at one place, on a linear spring, it
        is chi^2-distributed; for one that moves or slips it is large, however noisy the points.
        """
        joint, jacobian = self.joint, self.images.jacobian.T
        residual = self.images.residual
        scale = np.linalg.norm(jacobian, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        step = lstsq(jacobian / scale, residual, lapack_driver="gelsy")[0]
        remaining = residual - jacobian @ (step / scale)
        dof = len(joint.residual) - len(residual) + jacobian.shape[1] - len(joint.jacobian)
        return float(joint.residual @ joint.residual - remaining @ remaining), dof
