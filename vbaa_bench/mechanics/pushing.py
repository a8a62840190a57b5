"""Pushing any rod against any objects, one motor angle after another.

The equilibrium is followed from first contact, where linear theory tells it, in strides short
enough that the last two foretell the next. On the way the beam may roll from one edge of a mesh
to the next, and meet further objects.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, invert
from vbaa_bench.mechanics.bench import Bench, Equilibrium, Motor, Step
from vbaa_bench.mechanics.contact import Grip, Obstacle
from vbaa_bench.mechanics.meeting import DEEPEST, SCAN, check, deepest, nearest, smooth
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.mechanics.surfaces import Flat, Line, Solid, Surface

__all__ = ["Motor", "Step", "push", "rest"]

# How far an equilibrium is followed at once: radians of pushing, or deflection over L.
STRIDE = 0.06
# The same where a second object may be met, and must not be jumped over.
SHORT_STRIDE = 0.005
# The same where friction remembers the way: its direction follows the beam's as it slides aside.
FRICTION_STRIDE = 0.01

_TWO_EDGES = (
    "the beam comes to rest on two edges or corners of the mesh at once: "
    "a finer mesh or another angle is needed"
)


def rest(rod: Rod, intervals: int = 480) -> State:
    """The beam that touches nothing: straight, or bent by its weight and its bow.

    The centreline has `intervals` + 1 rows. Raises EquilibriumError if the weight is too much
    for the beam.
    """
    bench = Bench(rod, Motor(), (), np.array([1.0, 0.0, 0.0]))
    start = np.concatenate([np.cross([0.5, 0.0, 0.0], rod.total_weight(np.eye(3))), [0.0]])
    return bench.solve(Step(pushing_angle=0.0), {}, start).state(intervals)


def push(
    rod: Rod,
    motor: Motor,
    obstacles: Sequence[Obstacle],
    contact_distance: float,
    steps: Sequence[Step],
    intervals: int = 480,
) -> list[State]:
    """The states of one push, step after step.

    The first obstacle is what is pushed; it touches the beam at rest at arc length
    `contact_distance` [m], or is a wall. Others wait until the beam meets them. A step that has
    not reached contact yet gives the beam at rest. Only the first obstacle may have friction,
    which remembers the step before. Each centreline has `intervals` + 1 rows, one of them
    exactly at every contact. Raises EquilibriumError where no state is found, or where the beam
    could not stay: slipping off the tip or off a ball, pulled, cutting into an object, or on two
    edges of a mesh at once.
    """
    if any(other.friction for other in obstacles[1:]):
        raise ValueError("only the first obstacle may have friction")
    surface = obstacles[0].surface
    edge = len(obstacles) == 1 and isinstance(surface, Line) and surface.radius == 0
    if rod.shape == "rectangle" and not edge:
        raise ValueError("a beam of rectangular section can be pushed by one edge alone")
    free = rest(rod, intervals)
    bench = Bench(rod, motor, tuple(obstacles), free.tip / rod.beam.length)
    first_grip = Grip(contact_distance, np.zeros(3))
    grip, before = first_grip, None
    states = []
    for step in steps:
        if step.size <= 0:
            states.append(replace(free, pushing_angle=step.pushing_angle or 0.0))
            grip, before = first_grip, None
            continue
        for part in _way(before, step) if obstacles[0].friction else [step]:
            before = _settle(bench, part, contact_distance, free, grip, before)
            grip = Grip(before.contacts[0].s, before.contacts[0].touch.point)
        assert before is not None
        _outside(bench, before)
        check(before)
        states.append(before.state(intervals))
    return states


def _way(before: Equilibrium | None, step: Step) -> list[Step]:
    """Short steps from the one before, or from first contact, up to this one."""
    start = step.part(0.0) if before is None else before.step
    count = max(int(np.ceil(abs(step.size - start.size) / FRICTION_STRIDE)), 1)
    return [step.since(start, float(share)) for share in np.arange(1, count + 1) / count]


def _settle(
    bench: Bench,
    step: Step,
    contact_distance: float,
    free: State,
    grip: Grip,
    before: Equilibrium | None,
) -> Equilibrium:
    """One step: sticking while friction holds, else where it slides to."""
    friction = bench.obstacles[0].friction
    if friction and before is not None:
        try:
            engaged = {**dict.fromkeys(before.contacts), 0: replace(grip, sticks=True)}
            held = before.bench.solve(step, engaged, before.unknown)
        except EquilibriumError:
            pass  # friction has nothing to hold there
        else:
            if held.contacts[0].touch.slope <= friction:
                return held
    found = _reach(bench, step, contact_distance, free)
    if not friction:
        return found
    sliding = {**dict.fromkeys(found.contacts), 0: grip}
    return found.bench.solve(step, sliding, found.unknown)


def _reach(bench: Bench, step: Step, contact_distance: float, free: State) -> Equilibrium:
    """The equilibrium without friction, in finer strides where it is lost."""
    stride = STRIDE if len(bench.obstacles) == 1 else SHORT_STRIDE
    strides = int(np.ceil(step.size / stride))
    if isinstance(bench.obstacles[0].surface, Flat):
        strides = 1  # a wall's contact runs in from far off the tip
    for finer in (1, 2, 4):
        try:
            return _follow(bench, step, contact_distance, free, finer * strides)
        except EquilibriumError as error:
            failure = error
    raise failure


def _follow(
    bench: Bench, step: Step, contact_distance: float, free: State, strides: int
) -> Equilibrium:
    """The equilibrium without friction, followed from first contact in even strides."""
    on = smooth(bench, np.eye(4), free.centreline[:, 1:])
    path: list[Equilibrium] = []
    for share in np.arange(1, strides + 1) / strides:
        part = step.part(float(share))
        if not path:
            found = on.solve(part, {0: None}, _linear(bench, part, contact_distance, free))
        else:
            start = path[-1].unknown
            if len(path) > 1 and _alike(path[-2], path[-1]):
                start = 2 * start - path[-2].unknown
            found = on.solve(part, dict.fromkeys(path[-1].contacts), start)
        found = _rolled(bench, _met(found))
        on = found.bench
        path.append(found)
    return path[-1]


def _rolled(bench: Bench, found: Equilibrium) -> Equilibrium:
    """The same; on another edge or corner of `bench`'s meshes where the beam has rolled there."""
    tried: list[list[Surface]] = []
    while True:
        _, states, _ = found.traced(SCAN)
        line = states[:, :3] * bench.rod.beam.length
        other = smooth(bench, found.clamp_from_world, line)
        if _surfaces(other) == _surfaces(found.bench):
            return found
        tried.append(_surfaces(found.bench))
        start = found.unknown.copy()
        for i, index in enumerate(found.contacts):
            surface = other.obstacles[index].surface
            if surface is not found.bench.obstacles[index].surface:
                start[7 + 4 * i] = nearest(found, index, surface) / bench.rod.beam.length
        try:
            if _surfaces(other) in tried:
                raise EquilibriumError("it rolls to and fro")
            found = other.solve(found.step, dict.fromkeys(found.contacts), start)
        except EquilibriumError as error:
            raise EquilibriumError(_TWO_EDGES) from error


def _outside(bench: Bench, found: Equilibrium) -> None:
    """Raise EquilibriumError if the beam passes through one of `bench`'s meshes."""
    _, states, _ = found.traced(SCAN)
    for index, one in enumerate(bench.obstacles):
        if isinstance(one.surface, Solid):
            shift = found.contacts[index].touch.shift if index in found.contacts else 0.0
            object_from_clamp = invert(found.clamp_from_world @ one.world_from_object)
            line = states[:, :3] * bench.rod.beam.length - shift
            if one.surface.holds(apply(object_from_clamp, line)):
                raise EquilibriumError(_TWO_EDGES)


def _alike(one: Equilibrium, other: Equilibrium) -> bool:
    """Whether a third equilibrium may be foretold from these two."""
    same = _surfaces(one.bench) == _surfaces(other.bench)
    return same and list(one.contacts) == list(other.contacts)


def _surfaces(bench: Bench) -> list[Surface]:
    """What the beam may touch; each is equal to itself alone."""
    return [obstacle.surface for obstacle in bench.obstacles]


def _met(found: Equilibrium) -> Equilibrium:
    """The same, or with one further object touched where the beam has entered it."""
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


def _linear(bench: Bench, step: Step, contact_distance: float, free: State) -> Floats:
    """Unknowns by linear theory, (9) and (10): F = 3 EI y_c / x_c^3."""
    first, rod = bench.obstacles[0], bench.rod
    length = rod.beam.length
    x_0 = contact_distance / length
    give = 3 * first.compliance * rod.force_unit / length
    angle = step.size
    if step.deflection is not None:
        y_c = step.deflection * 2 * x_0 / (3 - x_0)
        angle = float(np.arctan(y_c * (1 + give / x_0**3) / x_0))
    normal, place = first.world_from_object[:3, 1], first.world_from_object[:3, 3]
    if isinstance(first.surface, Flat):  # it lifts off the wall like gap (1 - x / x_c)^3
        gap = -float(place @ normal + rod.beam.radius) / length
        x_0 = 3 * gap / angle
        force = 6 * gap / x_0**3 * normal
    else:
        world = bench.motor.clamp_from_world(angle, step.drift)
        moved = (world[:3, :3] @ place + world[:3, 3] - place) @ normal / length
        force = 3 * moved / (x_0**3 + give) * normal
        x_0 += step.drift[0] / length
    moment = np.cross([x_0, 0.0, 0.0], force) - free.base_moment / (rod.force_unit * length)
    return np.array([*moment, angle, *force, x_0])
