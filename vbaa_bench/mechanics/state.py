"""State of a bent beam in equilibrium, the result of every model of this package."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, freeze
from vbaa_bench.mechanics.rod import Rod

MAX_RESIDUAL = 1e-8


class EquilibriumError(Exception):
    """Error raised if no equilibrium is found, or none accurate enough to serve as truth."""


def check_residual(residual: float, failure: str) -> None:
    """Raise EquilibriumError, which begins with `failure`, unless a state is accurate enough."""
    if not residual <= MAX_RESIDUAL:
        raise EquilibriumError(
            f"{failure} (residual {residual:.1e}, allowed is {MAX_RESIDUAL:.0e})"
        )


def check_on_beam(s: float, length: float) -> None:
    """Raise EquilibriumError if a contact at arc length `s` [m] is at the tip or beyond it."""
    if s >= length:
        raise EquilibriumError(
            f"the beam slips off: contact arc length {s:.6g} m, "
            f"allowed is up to the tip at {length:.6g} m"
        )


@dataclass(frozen=True)
class Contact:
    """Contact of one object with the beam; SI, in the clamp's frame.

    `point` (3,) is on the centreline at arc length `s`, at row `row` of the state's
    centreline; `tangent` (3,) is the beam's there, `normal` (3,) points from the object's
    surface to the centreline, `lever` (3,) from the centreline to the touched point of the
    surface, and `force` (3,) is the object's force on the beam. `object_shift` (3,) is the
    object's displacement by its compliance, and `obstacle` the index of the obstacle.
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
            freeze(self, name, (3,))

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
    """Beam in equilibrium, in the clamp's frame (x along the clamp's tangent, z to the camera).

    `pushing_angle` [rad] is the clamp's rotation since first contact. `centreline`
    (n, 4) has columns s, x, y, z from the clamp to the tip [m]; `director` (n, 3) is the
    section's first axis, None for a circular beam whose sections need no orientation. `contacts`
    is empty for a beam that touches nothing. `base_force` and `base_moment` (3,) are those of
    the clamp on the beam. `largest_strain` is the largest bending strain of any fibre.
    `residual` is the worst relative error of the state's equations.
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
        line = freeze(self, "centreline", (None, 4))
        for name in ("base_force", "base_moment"):
            freeze(self, name, (3,))
        if self.director is not None:
            freeze(self, "director", (len(line), 3))

    @classmethod
    def of_rod(
        cls,
        rod: Rod,
        rows: Floats,
        states: Floats,
        pushing_angle: float,
        contacts: tuple[Contact, ...],
        base_force: Floats,
        residual: float,
    ) -> "State":
        """Convert the states (n, 12) of a rod at its arc lengths `rows` (n,), both in its units."""
        length = rod.beam.length
        return cls(
            pushing_angle=pushing_angle,
            contacts=contacts,
            base_force=base_force,
            base_moment=-states[0, 9:] * rod.force_unit * length,
            centreline=np.column_stack([rows, states[:, :3]]) * length,
            director=states[:, 3:6] if rod.oriented else None,
            largest_strain=rod.largest_strain(rows, states),
            residual=residual,
        )

    @property
    def tip(self) -> Floats:
        """Tip (3,) [m]."""
        return np.asarray(self.centreline[-1, 1:])

    def points_at(self, s: Floats) -> Floats:
        """Interpolate points (n, 3) [m] of the centreline at arc lengths (n,) [m]."""
        return interpolated(s, self.centreline[:, 0], self.centreline[:, 1:])

    @property
    def contact(self) -> Contact:
        """First contact. Raises ValueError if the beam touches nothing."""
        if not self.contacts:
            raise ValueError("the beam touches nothing")
        return self.contacts[0]


def interpolated(places: Floats, known_places: Floats, rows: Floats) -> Floats:
    """Interpolate rows (n, k), given at increasing `known_places` (n,), at other places (m,)."""
    return np.column_stack([np.interp(places, known_places, column) for column in rows.T])
