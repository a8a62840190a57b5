"""The beam of a changing section as the fits use it: shapes, contact and steps of one contact."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.beams.beam import CONTACT, OWN, S_C, BentBeam, Prior, Q, Radius
from solver.beams.integrated import STEPS, bent_beam
from solver.beams.steps import straight_in_free_end
from solver.beams.stretch import width_at
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats


@dataclass(frozen=True)
class IntegratedBeam:
    """Beam with `widths` coefficients of its width, and `bow` of its bow, as a `Beam`.

    `radius` is that at the clamp, over the length.
    """

    widths: int
    bow: int
    radius: float

    @cached_property
    def parameters(self) -> Parameters:
        """Those of the contact, of the width and of the bow."""
        return self.of_section()

    def of_section(self) -> Parameters:
        """Return the parameters of the contact, of the width and of the bow."""
        return Parameters((*CONTACT, ("widths", self.widths), ("bow", self.bow)))

    @property
    def prior(self) -> Mapping[str, Prior]:
        """No others."""
        return {}

    @property
    def positive(self) -> tuple[int, ...]:
        """Load and place."""
        return (Q, S_C)

    def bent(self, p: Floats) -> BentBeam | None:
        """Compute the shape with parameters p (k,); None if no beam has it."""
        curve, contact, gradients, moment, by_moment = bent_beam(p, self.widths, self.radius, STEPS)
        if not curve.exists:
            return None
        return BentBeam(curve, contact[None], gradients[None], moment, by_moment)

    def radius_at(self, p: Floats, s: float) -> Radius:
        """Compute the radius at the arc length s."""
        widths = p[OWN : OWN + self.widths]
        terms, gradient = np.zeros(max(self.widths, 1)), np.zeros(len(self.parameters))
        width, slope = width_at(s, widths, terms)
        gradient[S_C] = self.radius * slope
        gradient[OWN : OWN + self.widths] = self.radius * terms[: self.widths]
        return Radius(self.radius * width, gradient)

    def after_step(self, p: Floats, step: Floats, ray: float) -> Floats:
        """Return shape and clamp (k + 5,) after a step, in which the free end moves straight."""
        size = len(self.parameters)
        return straight_in_free_end(p, step, size, self.widths, self.radius, ray)
