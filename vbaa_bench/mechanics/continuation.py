"""Frictionless equilibrium by continuation from first contact, which starts from linear theory.

The strides are short enough to extrapolate from the last two equilibria. On the way the beam may
roll from one edge of a mesh to the next, and meet further objects.
"""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE
from vbaa_bench.mechanics.contact_checks import DEEPEST, SCAN, deepest, nearest, smooth
from vbaa_bench.mechanics.rod_contact import Equilibrium, RodContactProblem, Step
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.mechanics.surfaces import Flat, Surface

# Largest continuation stride: pushing angle [rad], or deflection over L.
STRIDE = 0.06
# Largest stride where the beam may meet a second object: a longer one could jump over it.
SHORT_STRIDE = 0.005
TWO_EDGES = (
    "the beam comes to rest on two edges or corners of the mesh at once: "
    "a finer mesh or another angle is needed"
)


def free(bench: RodContactProblem, step: Step) -> Equilibrium:
    """Solve for the beam at a step at which it touches nothing."""
    turned = bench.motor.clamp_from_world(step.size, step.drift)[:3, :3]
    moment = np.cross([0.5, 0.0, 0.0], bench.rod.total_weight(turned))
    return bench.solve(step, {}, np.array([*moment, step.size]))


def continue_from_first_contact(
    bench: RodContactProblem, step: Step, contact_distance: float, resting: State
) -> Equilibrium:
    """Find the frictionless equilibrium; repeat with finer strides if continuation fails."""
    stride = STRIDE if len(bench.obstacles) == 1 else SHORT_STRIDE
    strides = int(np.ceil(step.size / stride))
    if isinstance(bench.obstacles[0].surface, Flat):
        strides = 1  # the contact with a wall starts far beyond the tip
    for finer in (1, 2, 4):
        try:
            return _follow(bench, step, contact_distance, resting, finer * strides)
        except EquilibriumError as error:
            failure = error
    raise failure


def _follow(
    bench: RodContactProblem, step: Step, contact_distance: float, resting: State, strides: int
) -> Equilibrium:
    """Follow the frictionless equilibrium from first contact in even strides."""
    on = smooth(bench, np.eye(4), resting.centreline[:, 1:])
    path: list[Equilibrium] = []
    for share in np.arange(1, strides + 1) / strides:
        part = step.part(float(share))
        if not path:
            found = on.solve(part, {0: None}, _linear(bench, part, contact_distance, resting))
        else:
            start = path[-1].unknown
            if len(path) > 1 and _alike(path[-2], path[-1]):
                start = 2 * start - path[-2].unknown
            found = on.solve(part, dict.fromkeys(path[-1].contacts), start)
        found = _rolled(bench, _met(found))
        on = found.bench
        path.append(found)
    return path[-1]


def _rolled(bench: RodContactProblem, found: Equilibrium) -> Equilibrium:
    """Move contacts to another edge or corner of `bench`'s meshes if the beam has rolled there."""
    tried: list[list[Surface]] = []
    while True:
        _, states, _ = found.traced(SCAN)
        shift = found.contacts[0].touch.shift  # only the first object may yield
        line = states[:, :3] * bench.rod.beam.length - shift
        other = smooth(bench, found.clamp_from_world, line)
        if _surfaces(other) == _surfaces(found.bench):
            return found
        tried.append(_surfaces(found.bench))
        start = found.unknown.copy()
        try:
            for i, index in enumerate(found.contacts):
                surface = other.obstacles[index].surface
                if surface is not found.bench.obstacles[index].surface:
                    start[7 + 4 * i] = nearest(found, index, surface) / bench.rod.beam.length
            if _surfaces(other) in tried:
                raise EquilibriumError("it rolls to and fro")
            found = other.solve(found.step, dict.fromkeys(found.contacts), start)
        except (EquilibriumError, ValueError) as error:  # a trial contact beyond the beam's ends
            raise EquilibriumError(TWO_EDGES) from error


def _alike(one: Equilibrium, other: Equilibrium) -> bool:
    """Test whether two equilibria have the same surfaces and contacts, to extrapolate from them."""
    same = _surfaces(one.bench) == _surfaces(other.bench)
    return same and list(one.contacts) == list(other.contacts)


def _surfaces(bench: RodContactProblem) -> list[Surface]:
    """List the surfaces that the beam may touch; each is equal only to itself."""
    return [obstacle.surface for obstacle in bench.obstacles]


def _met(found: Equilibrium) -> Equilibrium:
    """Add a contact with one further object if the beam has entered it."""
    beam = found.bench.rod.beam
    for other in range(len(found.bench.obstacles)):
        if other in found.contacts:
            continue
        s, depth, normal = deepest(found, other)
        if depth > DEEPEST * beam.radius:
            place, entered = s / beam.length, depth / beam.length
            start = np.concatenate([found.unknown, 3 * entered / place**3 * normal, [place]])
            engaged = dict.fromkeys([*found.contacts, other])
            return found.bench.solve(found.step, engaged, start)
    return found


def _linear(
    bench: RodContactProblem, step: Step, contact_distance: float, resting: State
) -> Floats:
    """Estimate the unknowns by linear theory, (9) and (10): F = 3 EI y_c / x_c^3."""
    first, rod = bench.obstacles[0], bench.rod
    length = rod.beam.length
    x_0 = contact_distance / length
    give = 3 * first.compliance * rod.force_unit / length
    angle = step.size
    if step.deflection is not None:
        y_c = step.deflection * 2 * x_0 / (3 - x_0)
        angle = float(np.arctan(y_c * (1 + give / x_0**3) / x_0))
    normal, place = first.world_from_object[:3, 1], first.world_from_object[:3, 3]
    if isinstance(first.surface, Flat):  # its distance from the wall is gap (1 - x / x_c)^3
        gap = -float(place @ normal + rod.beam.radius) / length
        x_0 = 3 * gap / angle
        if x_0 >= 1:
            raise EquilibriumError(
                f"the beam lies along the wall from {x_0 * length:.4g} m on, allowed is before the "
                f"tip at {length:.4g} m: it must turn by more than {3 * gap / DEGREE:.4g} degrees"
            )
        force = 6 * gap / x_0**3 * normal
    else:
        world = bench.motor.clamp_from_world(angle, step.drift)
        moved = (world[:3, :3] @ place + world[:3, 3] - place) @ normal / length
        force = 3 * moved / (x_0**3 + give) * normal
        x_0 += step.drift[0] / length
    moment = np.cross([x_0, 0.0, 0.0], force) - resting.base_moment / (rod.force_unit * length)
    return np.array([*moment, angle, *force, x_0])
