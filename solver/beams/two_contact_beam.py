"""The beam of a changing section as the fits use it, with two contacts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.beams.beam import S_C, BentBeam, Prior, Q, Radius
from solver.beams.integrated_beam import IntegratedBeam
from solver.beams.two_contacts import STEPS, contacts_of, two_contacts_of
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats

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


def _moments(forces: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Compute the derivatives (4, 2) of the forces' moments of order 0 to 3, by force and place."""
    order = np.arange(4)[:, None]
    return places**order, order * forces * places ** np.maximum(order - 1, 0)
