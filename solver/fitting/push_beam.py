"""The beam of a push and the points of its frames: contacts, first touch, rows of residuals.

A shape has the parameters q, the force across the beam over EI at the clamp [1/m^2]; its place, the
contact's arc length [m]; the friction ratio; and b parameters of beam and clamp, which all frames
share.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.beams.curve import END
from solver.fitting import frames
from solver.fitting.frame_problem import FrameProblem
from solver.fitting.frame_values import fitted_contact, input_variances
from solver.fitting.push_geometry import FirstTouch, ShapeContacts
from solver.fitting.robust_fit import residuals_at
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig

# Largest place over the arc length to which a curve is integrated. Chosen.
_FARTHEST = 0.999


class PushPrior(NamedTuple):
    """Mean (b,) of the parameters of beam and clamp, and a root (b, b) of their information."""

    mean: Floats
    root: Floats


class LastShape(NamedTuple):
    """Values (m,) by name of a frame, and their Jacobian (m, b + 6).

    The Jacobian is by q, place, the parameters of beam and clamp, friction ratio, motor angle, and
    the relative errors of EI and of all lengths, of which `input_variances` (2,) are those of the
    last two. `placement` (m, m) is the covariance due to the error of Sigma_a.
    """

    values: dict[str, float]
    jacobian: Floats
    input_variances: Floats
    placement: Floats


class PushPoints(NamedTuple):
    """Points of a frame without outliers, and their variance inflation."""

    problem: FrameProblem
    variance_inflation: float


@dataclass(frozen=True)
class PushBeam:
    """Beam of a rig, and the points of a push's n frames.

    The b parameters of beam and clamp are those that `FrameProblem` fits and that frames share, and
    the errors that all points share.
    """

    frames: tuple[PushPoints, ...]
    rig: Rig

    @cached_property
    def fitted(self) -> Floats:
        """Indices (b,) of the parameters of beam and clamp among those of a frame's problem."""
        free = self._problem.free
        return np.asarray(
            free[~np.isin(free, (Q, S_C, FRICTION_RATIO)) & (free < self._problem.common)]
        )

    @property
    def points(self) -> int:
        """Number of points in all frames."""
        return sum(len(frame.problem.shared) for frame in self.frames)

    @cached_property
    def prior(self) -> PushPrior:
        """The prior of beam, clamp and shared errors."""
        information = self._problem.information[np.ix_(self.fitted, self.fitted)]
        unit = np.sqrt(np.diag(information))
        values, vectors = np.linalg.eigh(information / np.outer(unit, unit))
        root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        return PushPrior(self._problem.mean[self.fitted], np.asarray(root * unit))

    @property
    def own(self) -> Mapping[str, int]:
        """Places of the parameters of a user's own beam among the fitted ones, by name."""
        at, fitted = self._problem.parameters, self.fitted.tolist()
        return {
            name: fitted.index(at[name]) for name in self._problem.beam.prior if at[name] in fitted
        }

    @property
    def farthest(self) -> float:
        """Largest place [m]: where curves end."""
        return _FARTHEST * END * self.rig.beam.length

    def contacts(
        self, q: Floats, place: Floats, friction_ratio: Floats, beam: Floats
    ) -> ShapeContacts | None:
        """Compute the contacts (n,) of shapes, relative to the clamp's tangent without load.

        The gradients (3 + b, n) are by q, place, friction ratio, and the parameters of beam and
        clamp. Returns None if a shape does not exist.
        """
        rows = [
            self._contact(i, self._parameters(i, *shape, beam))
            for i, shape in enumerate(zip(q, place, friction_ratio, strict=True))
        ]
        present = [row for row in rows if row is not None]
        if len(present) < len(rows):
            return None
        length = self.rig.beam.length
        table = np.moveaxis(np.array(present), 0, -1)  # (6, 1 + p, n)
        table *= np.array([length**-2, 1.0, length, length, length, 1.0])[:, None, None]
        gradients = table[:, 1 + np.array([Q, S_C, FRICTION_RATIO, *self.fitted])]
        gradients[:, 0] *= length**2
        gradients[:, 1] /= length
        return ShapeContacts(table[:, 0], gradients)

    def first_touch(self, x0: float, beam: Floats) -> FirstTouch:
        """Compute the line of the beam at first contact, with gradients (3, 1 + b) by x0 and beam.

        It is that of the bowed beam, at the surface of a beam as thick as at its clamp.
        """
        length, bow = self.rig.beam.length, self._problem.parameters.span("bow")
        p, x = self._parameters(0, 0.0, x0, 0.0, beam), x0 / length
        orders = np.arange(2, 2 + bow.stop - bow.start)
        height, slope = p[bow] @ x**orders, p[bow] @ (orders * x ** (orders - 1))
        bend = p[bow] @ (orders * (orders - 1) * x ** (orders - 2))
        angle, (excess, by_excess) = math.atan(slope), self._thicker(p, x)
        sine, cosine = math.sin(angle), math.cos(angle)
        position, across = x * cosine + height * sine, height * cosine - x * sine
        # By x0, and by all parameters.
        gradients = np.zeros((3, 1 + len(p)))
        by_bow = slice(1 + bow.start, 1 + bow.stop)
        gradients[2, 0] = bend * cosine**2
        gradients[2, by_bow] = orders * x ** (orders - 1) * cosine**2
        gradients[0] = across * gradients[2]
        gradients[1] = -position * gradients[2]
        gradients[0, 0] += cosine + slope * sine
        gradients[1, 0] += slope * cosine - sine
        gradients[0, by_bow] += x**orders * sine
        gradients[1, by_bow] += x**orders * cosine
        gradients[1, 0] -= by_excess[S_C]
        gradients[1, 1:] -= np.where(np.arange(len(p)) == S_C, 0.0, by_excess)
        chosen = gradients[:, [0, *(1 + self.fitted)]]
        chosen[:2, 1:] *= length
        chosen[2, 0] /= length
        return FirstTouch(float(position * length), float(across - excess) * length, angle, chosen)

    def rows(
        self, frame: int, q: float, place: float, friction_ratio: float, beam: Floats
    ) -> Floats | None:
        """Compute rows in sigmas: Jacobian by q, place, beam and clamp, friction ratio; residual.

        They have the sum of squares and the gradient of all points (QR), so that the size of a
        joint problem depends only on the number of frames. Returns None if the shape does not
        exist.
        """
        problem, inflation = self.frames[frame]
        own, count = problem.own_errors, len(problem.mean)
        shared = self._parameters(frame, q, place, friction_ratio, beam)
        at = residuals_at(problem, np.append(shared, np.zeros(own)))
        if at is None:
            return None
        length = self.rig.beam.length
        # Errors of this frame's own, with unit prior, come first: they are eliminated.
        order = [*range(count - own, count), Q, S_C, *self.fitted, FRICTION_RATIO]
        columns = np.vstack([at[1][order], at[0]])
        columns[own] *= length**2
        columns[own + 1] /= length
        prior = np.eye(own, len(columns)) * math.sqrt(inflation)
        condensed = np.asarray(np.linalg.qr(np.vstack([prior, columns.T]), mode="r"))
        return condensed[own:, own:] / math.sqrt(inflation)

    def last_shape(
        self,
        last: Measurement,
        q: float,
        place: float,
        beam: Floats,
        friction_ratio: float,
        motor_angle: float,
    ) -> LastShape:
        """Compute the values of the last frame, whose shape has these parameters."""
        p = self._parameters(len(self.frames) - 1, q, place, friction_ratio, beam)
        contact, by_p = fitted_contact(self.rig, self.frames[-1].problem, p, motor_angle)
        values, by_contact, placement = frames.in_all_frames(last, contact, clamp_fitted=True)
        count = len(p)
        columns = [Q, S_C, *self.fitted, FRICTION_RATIO, count, count + 1, count + 2]
        jacobian = (by_contact @ by_p)[:, columns]
        jacobian[:, 0] *= self.rig.beam.length**2
        jacobian[:, 1] /= self.rig.beam.length
        return LastShape(values, jacobian, input_variances(last)[1:], placement)

    @property
    def _problem(self) -> FrameProblem:
        """Problem whose prior all frames share."""
        return self.frames[0].problem

    def _parameters(
        self, frame: int, q: float, place: float, friction_ratio: float, beam: Floats
    ) -> Floats:
        """Return the parameters (p,) of a frame's problem before the errors of the frame's own.

        The bow differs from that of the first frame by what the beam's own weight changes.
        """
        problem, length = self.frames[frame].problem, self.rig.beam.length
        p = problem.mean[: problem.common].copy()
        p[[Q, S_C, FRICTION_RATIO]] = q * length**2, place / length, friction_ratio
        p[self.fitted] += beam - self._problem.mean[self.fitted]
        return p

    def _contact(self, frame: int, p: Floats) -> Floats | None:
        """Compute the quantities of `BentBeam` relative to the clamp, with gradients (6, 1 + p).

        The contact is that of a beam as thick as at its clamp. Returns None without a shape.
        """
        bent = self.frames[frame].problem.bent(p)
        if bent is None:
            return None
        excess, by_excess = self._thicker(p, p[S_C])
        softness = self._problem.parameters["softness"]
        return np.asarray(
            _mounted(
                bent.contacts[-1], bent.by_contacts[-1], bent.moment, bent.by_moment,
                excess, by_excess, p[softness], softness,
            )
        )  # fmt: skip

    def _thicker(self, p: Floats, s: float) -> tuple[float, Floats]:
        """Compute the radius at s over that at the clamp, as a difference, with gradient (p,)."""
        beam, gradient = self._problem.beam, np.zeros(len(p))
        radius = beam.radius_at(p, s)
        gradient[: len(radius.gradient)] = radius.gradient
        return radius.value - beam.radius, gradient


@njit
def _mounted(
    contact: Floats,
    by_contact: Floats,
    moment: float,
    by_moment: Floats,
    excess: float,
    by_excess: Floats,
    softness: float,
    index: int,
) -> Floats:
    """Move a contact (6,) by the `excess` of the radius, and turn it with a compliant clamp.

    Returns it with its gradient, (6, 1 + p), by p parameters, of which the first k are those of the
    shape, by which `by_contact` (6, k) and `by_moment` (k,) are derivatives; `index` is that of the
    softness, and `by_excess` (p,) is the gradient of the excess.
    """
    size, count = len(by_moment), len(by_excess)
    table = np.zeros((6, 1 + count))
    for i in range(6):
        table[i, 0] = contact[i]
        for j in range(size):
            table[i, 1 + j] = by_contact[i, j]
    sine, cosine = np.sin(contact[1]), np.cos(contact[1])
    turn = softness * moment
    turn_sine, turn_cosine = np.sin(turn), np.cos(turn)
    for j in range(1 + count):
        surface = by_excess[j - 1] if j else excess
        by_theta = excess * table[1, j] if j else 0.0
        x = table[2, j] + sine * surface + cosine * by_theta
        y = table[3, j] - cosine * surface + sine * by_theta
        table[2, j] = turn_cosine * x - turn_sine * y
        table[3, j] = turn_sine * x + turn_cosine * y
    table[1, 0] += turn
    for j in range(count):
        by_turn = softness * by_moment[j] if j < size else 0.0
        if j == index:
            by_turn += moment
        table[1, 1 + j] += by_turn
        table[2, 1 + j] -= table[3, 0] * by_turn
        table[3, 1 + j] += table[2, 0] * by_turn
    return table
