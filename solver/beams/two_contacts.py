"""Exact beam of a changing section, bowed at rest, with two contacts and friction: integrated.

Beyond the outer contact the beam is that of `integrated`, with the same frame, width and bow;
between the contacts it carries the outer force, and from the inner contact to the clamp both, so
that with the inner force's lever arm h

    u' = cos(psi),    P' = sin(psi),    psi' = (Q_o u + Q_i h) / w(s)^4 + b(s)

(Antman 2005, ch. IV). Both forces may have either sign. Where one of them vanishes this is the beam
of `integrated`; where their sum vanishes nothing is singular.

All lengths are in units of the beam's length. A shape has the parameters of `integrated`, those of
the outer contact, and then (q_i, s_i, ratio_i) of the inner one. This module is compiled.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO, S_C, BentBeam, Prior, Q, Radius
from solver.beams.curve import END, MOST_ANGLE, Curve
from solver.beams.integrated import FREE_STEPS, IntegratedBeam
from solver.beams.stretch import (
    ALPHA,
    INNER,
    LINE_P,
    LINE_U,
    LOAD,
    WIDTHS,
    Stretch,
    march,
    moment_at,
    width_at,
    write_contact,
)
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats, copy_into
from solver.instrument.compiled import njit

# Parameters of the inner contact, counted from the shape's end.
Q_INNER, S_INNER, FRICTION_RATIO_INNER = -3, -2, -1
INNER_PARAMETERS: Final = 3
# Steps on either side of the inner contact. Measured: the error of a contact's place is 1e-8 for a
# uniform beam bent by 40 degrees. As in `integrated`, neither a literal nor a default value.
STEPS: Final[Any] = np.int64(16)
# Entries of a contact, as in `beam.BentBeam`: force over EI, tangent's angle, x, y, s, lean.
CONTACT: Final = 6
_INNER = (("q_inner", 1), ("s_c_inner", 1), ("friction_ratio_inner", 1))


@dataclass(frozen=True)
class TwoContactBeam:
    """A `one` beam with a second, inner contact, as a `Beam`: the first three are the outer one."""

    one: IntegratedBeam

    @cached_property
    def parameters(self) -> Parameters:
        """Those of the outer contact, of the width and the bow, and of the inner contact."""
        return self.one.parameters.followed_by(*_INNER)

    @property
    def radius(self) -> float:
        """Radius at the clamp."""
        return self.one.radius

    @property
    def prior(self) -> Mapping[str, Prior]:
        """No others."""
        return {}

    @property
    def forces(self) -> list[int]:
        """Indices of the forces, the outer one first."""
        return [Q, self.parameters["q_inner"]]

    @property
    def places(self) -> list[int]:
        """Indices of the contacts' places, the outer one first."""
        return [S_C, self.parameters["s_c_inner"]]

    @property
    def positive(self) -> tuple[int, ...]:
        """Places: the forces may have either sign."""
        return tuple(self.places)

    def bent(self, p: Floats) -> BentBeam | None:
        """Compute the shape with parameters p (k,); None if no beam has it."""
        both = two_contacts_of(p, self.one.widths, self.one.radius, STEPS)
        if not both.curve.exists:
            return None
        return BentBeam(both.curve, *contacts_of(both, p), both.moment, both.by_moment)

    def radius_at(self, p: Floats, s: float) -> Radius:
        """Compute the radius at the arc length s."""
        value, gradient = self.one.radius_at(p, s)
        return Radius(value, np.append(gradient, np.zeros(len(_INNER))))

    def after_step(self, p: Floats, step: Floats, ray: float) -> Floats:
        """Return shape and clamp (k + 5,) after a step; NaN where no two contacts have its moments.

        In linear theory the beam before both contacts depends on the forces' moments about the
        clamp of order 0 and 1, beyond them on those of order 2 and 3, and linearly on all four. A
        step is therefore straight in the moments, which follow the curved valley of the objective.
        """
        del ray
        moved, forces, places = p + step, self.forces, self.places
        by_force, by_place = _moments(p[forces], p[places])
        moments = by_force @ (p[forces] + step[forces]) + by_place @ step[places]
        moved[[*forces, *places]] = np.nan
        # The two places are the nodes of Gauss's quadrature with these moments.
        determinant = moments[0] * moments[2] - moments[1] ** 2
        if determinant != 0:
            total = (moments[0] * moments[3] - moments[1] * moments[2]) / determinant
            product = (moments[1] * moments[3] - moments[2] ** 2) / determinant
            root = total**2 - 4 * product
            if root > 0:
                outer, inner = (total + math.sqrt(root)) / 2, (total - math.sqrt(root)) / 2
                load = (moments[1] - inner * moments[0]) / (outer - inner)
                moved[places], moved[forces] = (outer, inner), (load, moments[0] - load)
        return moved


class TwoContacts(NamedTuple):
    """A shape's curve, (u, P, psi) (3,) at the inner contact and the moment over EI at the clamp.

    The gradients `by_inner` (k, 3) and `by_moment` (k,) are by the parameters. The curve's
    `contact` is the outer one.
    """

    curve: Curve
    inner: Floats
    by_inner: Floats
    moment: float
    by_moment: Floats


@njit
def _inner_force(
    p: Floats, bow: int, radius: float, y: Floats, by: Floats, force: Floats, by_force: Floats
) -> None:
    """Write the inner force (4,) at a contact with the state y (3,), and its gradient (k, 4).

    Its line passes the centreline at a distance, as friction acts on the surface.
    """
    k, friction_ratio = len(p), p[FRICTION_RATIO_INNER]
    square = 1 + friction_ratio * friction_ratio
    root = np.sqrt(square)
    sine = friction_ratio / root
    terms = np.zeros(k - INNER_PARAMETERS - WIDTHS)
    width, slope = width_at(p[S_INNER], p[WIDTHS:bow], terms)
    sided = radius if p[Q_INNER] >= 0 else -radius
    arm, by_arm = sided * width * sine, np.zeros(k)
    by_arm[S_INNER], by_arm[FRICTION_RATIO_INNER] = (
        sided * slope * sine,
        sided * width / square**1.5,
    )
    for i in range(WIDTHS, bow):
        by_arm[i] = sided * sine * terms[i - WIDTHS]
    alpha = y[2] + np.arctan(friction_ratio)
    cosine, across = np.cos(alpha), np.sin(alpha)
    force[LOAD], force[ALPHA] = p[Q_INNER] * root, alpha
    force[LINE_U], force[LINE_P] = y[0] - arm * cosine, y[1] - arm * across
    copy_into(by_force[:, ALPHA], by[:, 2])
    by_force[FRICTION_RATIO_INNER, ALPHA] += 1 / square
    by_force[Q_INNER, LOAD], by_force[FRICTION_RATIO_INNER, LOAD] = (
        root,
        p[Q_INNER] * friction_ratio / root,
    )
    for i in range(k):
        turn = by_force[i, ALPHA]
        by_force[i, LINE_U] = by[i, 0] - by_arm[i] * cosine + arm * across * turn
        by_force[i, LINE_P] = by[i, 1] - by_arm[i] * across - arm * cosine * turn


@njit
def two_contacts_of(p: Floats, widths: int, radius: float, steps: Any) -> TwoContacts:
    """Integrate the shape with parameters p (k,), with `steps` on either side of the inner contact.

    `widths` and `radius` are those of `integrated.curve_of`. The curve has the nodes beyond the
    tip, at the outer contact, and back to the clamp; a contact has one on either side, as there.
    """
    k, bow = len(p), WIDTHS + widths
    bow_end, s_inner = k - INNER_PARAMETERS, k + S_INNER
    free_steps = FREE_STEPS if bow_end > bow else 1
    nodes = np.zeros((4, free_steps + 2 * steps + 3))
    gradients = np.zeros((k, 2, free_steps + 2 * steps + 3))
    y, by, by_arm = np.zeros(3), np.zeros((k, 3)), np.zeros(k)
    inner, by_inner = np.zeros(3), np.zeros((k, 3))
    force, by_force = np.zeros(INNER), np.zeros((k, INNER))
    exists = 0 < p[S_INNER] < p[S_C] and abs(p[FRICTION_RATIO_INNER]) < np.tan(MOST_ANGLE)
    for stretch in (
        Stretch(S_C, -1, END, 0, free_steps, free_steps, -1),
        Stretch(S_C, s_inner, 0.0, 1, steps, free_steps + 1, 1),
        Stretch(s_inner, -1, 0.0, 2, steps, free_steps + steps + 2, 1),
    ):
        if exists and stretch.loads < 2:
            exists = write_contact(p, bow, bow_end, radius, y, by)
            copy_into(by_arm, by[:, 0])
        elif exists:
            copy_into(inner, y)
            copy_into(by_inner, by)
            _inner_force(p, bow, radius, y, by, force, by_force)
        exists = exists and march(
            y, by, p, bow, bow_end, stretch, force, by_force, nodes, gradients
        )
    by_moment = np.zeros(k)
    moment = moment_at(y, by, p, force, by_force, 2, by_moment)
    curve = Curve(nodes, gradients, free_steps, by_arm, y, by, exists)
    return TwoContacts(curve, inner, by_inner, moment, by_moment)


@njit
def contacts_of(shape: TwoContacts, p: Floats) -> tuple[Floats, Floats]:
    """Compute both contacts (2, 6), the inner one first, and their gradients (2, 6, k).

    Each is (force over EI, theta, x, y, s, lean) in the clamp's frame, as in `beam.BentBeam`: the
    force is positive to the side of +y.
    """
    k = len(p)
    values, gradients = np.empty((2, CONTACT)), np.zeros((2, CONTACT, k))
    base, by_base = shape.curve.base, shape.curve.by_base
    cosine, sine = np.cos(base[2]), np.sin(base[2])
    outer, by_outer = np.zeros(3), np.zeros((k, 3))
    outer[0], outer[2] = shape.curve.nodes[0, shape.curve.contact], -np.arctan(p[FRICTION_RATIO])
    copy_into(by_outer[:, 0], shape.curve.by_arm)
    by_outer[FRICTION_RATIO, 2] = -1 / (1 + p[FRICTION_RATIO] ** 2)
    for j, load, arc, rub, place, by_place in (
        (0, k + Q_INNER, k + S_INNER, k + FRICTION_RATIO_INNER, shape.inner, shape.by_inner),
        (1, Q, S_C, FRICTION_RATIO, outer, by_outer),
    ):
        square = 1 + p[rub] ** 2
        root = np.sqrt(square)
        along, height = base[0] - place[0], base[1] - place[1]
        x, y = along * cosine + height * sine, along * sine - height * cosine
        values[j, 0], values[j, 1] = p[load] * root, base[2] - place[2]
        values[j, 2], values[j, 3] = x, y
        values[j, 4], values[j, 5] = p[arc], -np.arctan(p[rub])
        gradients[j, 0, load], gradients[j, 0, rub] = root, p[load] * p[rub] / root
        gradients[j, 4, arc], gradients[j, 5, rub] = 1.0, -1 / square
        for i in range(k):
            by_along, by_height = by_base[i, 0] - by_place[i, 0], by_base[i, 1] - by_place[i, 1]
            gradients[j, 1, i] = by_base[i, 2] - by_place[i, 2]
            gradients[j, 2, i] = by_along * cosine + by_height * sine - y * by_base[i, 2]
            gradients[j, 3, i] = by_along * sine - by_height * cosine + x * by_base[i, 2]
    return values, gradients


def _moments(forces: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Compute the derivatives (4, 2) of the forces' moments of order 0 to 3, by force and place."""
    order = np.arange(4)[:, None]
    return places**order, order * forces * places ** np.maximum(order - 1, 0)
