"""Statics of a rod under prescribed contact forces, without the objects that exert them.

The information in an image is the change of the beam's shape with place, size and direction of the
contact force. Here these are prescribed, whereas `pushing` determines them from objects and a
motor. Lengths are in units of L and forces in units of EI / L^2 inside, as in `rod`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import root

from solver.instrument.arrays import Floats
from vbaa_bench.mechanics.rod import Rod, cross, trace
from vbaa_bench.mechanics.state import State, check_residual


@dataclass(frozen=True)
class Load:
    """Force of an object on a round beam, at the arc length `s` [m] of its axis.

    `normal_force` [N] is across the beam's tangent, in the plane of the tangent and the direction
    that is inclined by `direction` [rad] from y to z in the clamp's frame. `friction` holds the
    ratios to it of the forces along the tangent and along the binormal, normal x tangent; they act
    on the beam's surface, one radius from the axis.
    """

    s: float
    normal_force: float
    direction: float = 0.0
    friction: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, state: State, index: int = 0) -> "Load":
        """Extract the load of one of a state's contacts.

        The surface's slope against the axis of a tapered beam is neglected in the force's lever.
        """
        contact = state.contacts[index]
        tangent, force = contact.tangent, contact.force
        normal = contact.normal - (contact.normal @ tangent) * tangent
        normal /= np.linalg.norm(normal)
        size = float(force @ normal)
        # The direction has no component along the clamp's tangent.
        direction = normal - normal[0] / tangent[0] * tangent
        binormal = np.cross(normal, tangent)
        return cls(
            contact.s,
            size,
            float(np.arctan2(direction[2], direction[1])),
            (float(force @ tangent) / size, float(force @ binormal) / size),
        )


class LoadedBeam(NamedTuple):
    """Beam under m loads, in the clamp's frame.

    `centreline` (n, 4) has columns s, x, y, z [m]; `points` (m, 3) [m] and `tangents` (m, 3) are
    those at the loads, `forces` (m, 3) [N] the loads' forces on the beam, and `base_moment` (3,)
    [N m] is the moment of the clamp on the beam.
    """

    centreline: Floats
    points: Floats
    tangents: Floats
    forces: Floats
    base_moment: Floats


def loaded(
    rod: Rod, loads: Sequence[Load], arc_lengths: Floats, turned: Floats | None = None
) -> LoadedBeam:
    """Find the shape of a rod under loads at arc lengths (n,) [m], which increase from 0 to L.

    Its weight acts in the world, which is `turned` (3, 3) against the clamp. The unknowns are the
    clamp's moment and the tangents at the loads, on which the forces' directions depend: the
    moment at the tip must vanish. Raises EquilibriumError if no equilibrium is found from that of
    linear theory.
    """
    length, unit = rod.beam.length, rod.force_unit
    world = np.eye(3) if turned is None else turned
    order = sorted(range(len(loads)), key=lambda i: loads[i].s)
    stops = np.array([loads[i].s for i in order]) / length
    rows = np.unique(np.concatenate([arc_lengths / length, stops, [0.0, 1.0]]))
    at_loads = np.searchsorted(rows, stops)
    properties, steps = rod.properties(world), int(np.ceil(rod.steps / len(rows)))

    def forces_and_couples(tangents: Floats) -> tuple[Floats, Floats]:
        both = [
            _force_and_couple(rod, loads[i], tangent)
            for i, tangent in zip(order, tangents, strict=True)
        ]
        forces, couples = np.array(both).reshape(-1, 2, 3).transpose(1, 0, 2)
        return np.ascontiguousarray(forces), np.ascontiguousarray(couples)

    def states(unknown: Floats) -> Floats:
        forces, couples = forces_and_couples(unknown[3:].reshape(-1, 3))
        return trace(rod.clamp(unknown[:3]), stops, forces, couples, rows, properties, steps)

    def errors(unknown: Floats) -> Floats:
        traced = states(unknown)
        return np.concatenate([traced[-1, 9:], traced[at_loads, 6:9].ravel() - unknown[3:]])

    straight = np.tile([1.0, 0.0, 0.0], (len(loads), 1))
    forces, couples = forces_and_couples(straight)
    moment = (np.cross(stops[:, None] * straight, forces) + couples).sum(axis=0)
    moment += rod.weight_moment(world)
    # Trial values may overflow; a residual that is not finite is an error below.
    with np.errstate(over="ignore", invalid="ignore"):
        solution = root(
            errors,
            np.concatenate([moment, straight.ravel()]),
            method="hybr",
            options={"xtol": 1e-14},
        )
        residual = float(np.abs(errors(solution.x)).max() / np.abs(solution.x[:3]).max(initial=1.0))
    check_residual(residual, "no equilibrium under the loads")
    traced = states(solution.x)
    forces, _ = forces_and_couples(solution.x[3:].reshape(-1, 3))
    kept, original = np.searchsorted(rows, arc_lengths / length), np.argsort(order)
    return LoadedBeam(
        centreline=np.column_stack([rows[kept], traced[kept, :3]]) * length,
        points=traced[at_loads, :3][original] * length,
        tangents=traced[at_loads, 6:9][original],
        forces=forces[original] * unit,
        base_moment=-solution.x[:3] * unit * length,
    )


def _force_and_couple(rod: Rod, load: Load, tangent: Floats) -> tuple[Floats, Floats]:
    """Compute force (3,) and moment about the axis (3,) of a load at a tangent (3,)."""
    direction = np.array([0.0, np.cos(load.direction), np.sin(load.direction)])
    across = direction - (direction @ tangent) / (tangent @ tangent) * tangent
    normal = across / np.linalg.norm(across)
    along, aside = load.friction
    force = normal + along * tangent + aside * cross(normal, tangent)
    force *= load.normal_force / rod.force_unit
    lever = -rod.half_height(load.s) / rod.beam.length * normal
    return force, cross(lever, force)
