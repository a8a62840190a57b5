"""A bent beam in equilibrium, as every model of this room answers it."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, frozen_floats

WORST_RESIDUAL = 1e-8


class EquilibriumError(Exception):
    """No equilibrium was found, or not accurately enough to be called truth."""


@dataclass(frozen=True)
class Contact:
    """Where one object touches the beam; SI, in the clamp's frame.

    `point` (3,) lies on the centreline at arc length `s`, on row `row` of the state's
    centreline; `tangent` (3,) is the beam's there, `normal` (3,) points from the object's
    surface to the centreline, `lever` (3,) from the centreline to the touched point of the
    surface, and `force` (3,) is the object's on the beam. `object_shift` (3,) is how far the
    object has given way from its place, and `obstacle` which of the obstacles it is.
    """

    s: float
    point: Floats
    tangent: Floats
    normal: Floats
    lever: Floats
    force: Floats
    object_shift: Floats
    row: int
    obstacle: int = 0

    def __post_init__(self) -> None:
        for name in ("point", "tangent", "normal", "lever", "force", "object_shift"):
            object.__setattr__(self, name, frozen_floats(name, getattr(self, name), (3,)))

    @property
    def theta(self) -> float:
        """Angle [rad] between the beam's tangent at the contact and the clamp's."""
        return float(np.arctan2(np.linalg.norm(self.tangent[1:]), self.tangent[0]))

    @property
    def psi(self) -> float:
        """Inclination [rad] of the force's part across the clamp's tangent, against plane C."""
        return float(np.arctan2(self.force[2], self.force[1]))


@dataclass(frozen=True)
class State:
    """A beam in equilibrium, in the clamp's frame (x along the clamp's tangent, z to the camera).

    `pushing_angle` [rad] is how far the clamp has turned since first contact. `centreline`
    (n, 4) has columns s, x, y, z from the clamp to the tip [m]; `director` (n, 3) is the
    section's first axis, None for a circular beam whose sections need no orientation. `contacts`
    is empty for a beam that touches nothing. `base_force` and `base_moment` (3,) are what the
    clamp exerts on the beam. `largest_strain` is that of any fibre by bending.
    `residual` is the worst relative error of the equations that the state fulfils.
    """

    pushing_angle: float
    contacts: tuple[Contact, ...]
    base_force: Floats
    base_moment: Floats
    centreline: Floats
    director: Floats | None
    largest_strain: float
    residual: float

    def __post_init__(self) -> None:
        line = frozen_floats("centreline", self.centreline, (None, 4))
        object.__setattr__(self, "centreline", line)
        for name in ("base_force", "base_moment"):
            object.__setattr__(self, name, frozen_floats(name, getattr(self, name), (3,)))
        if self.director is not None:
            director = frozen_floats("director", self.director, (len(line), 3))
            object.__setattr__(self, "director", director)

    @property
    def tip(self) -> Floats:
        """Tip (3,) [m]."""
        return np.asarray(self.centreline[-1, 1:])

    @property
    def contact(self) -> Contact:
        """The first contact. Raises ValueError if the beam touches nothing."""
        if not self.contacts:
            raise ValueError("the beam touches nothing")
        return self.contacts[0]
