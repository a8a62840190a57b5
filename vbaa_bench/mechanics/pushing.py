"""Push any rod against any objects, one motor angle after another.

A step without contact gives the free beam. A step in contact is solved by continuation from first
contact or, because friction depends on the path, from the step before.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.contact_checks import MAX_DEPTH, SCAN, check, deepest, in_object
from vbaa_bench.mechanics.continuation import TWO_EDGES, continue_from_first_contact, free
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Equilibrium, Motor, RodContactProblem, Step
from vbaa_bench.mechanics.sliding import first_contact, slide
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.mechanics.surfaces import Ball, Flat, Line, Solid


@lru_cache(maxsize=16)
def rest(rod: Rod, intervals: int = 480) -> State:
    """Compute the beam that touches nothing: straight, or bent by its weight and its bow.

    The centreline has `intervals` + 1 rows. Raises EquilibriumError if the weight is too large
    for the beam.
    """
    return free(RodContactProblem(rod, Motor(), (), np.array([1.0, 0.0, 0.0])), Step(0.0)).state(
        intervals
    )


def push(
    rod: Rod,
    motor: Motor,
    obstacles: Sequence[Obstacle],
    contact_distance: float,
    steps: Sequence[Step],
    intervals: int = 480,
) -> list[State]:
    """Compute the states of one push, step after step.

    The beam is pushed against the first obstacle, which touches the beam at rest at arc length
    `contact_distance` [m], or is a wall. The beam may meet the others later. A step before
    contact gives the free beam. Only the first obstacle may have friction, which depends on the
    step before. Each centreline has `intervals` + 1 rows, one of them exactly at every contact.
    Raises EquilibriumError where no state is found, or where the state is impossible: the beam
    slips off at the tip or off a ball, is pulled, cuts into an object, or rests on two edges of
    a mesh at once.
    """
    if any(obstacle.friction for obstacle in obstacles[1:]):
        raise ValueError("only the first obstacle may have friction")
    surface = obstacles[0].surface
    edge = len(obstacles) == 1 and isinstance(surface, Line) and surface.radius == 0
    if rod.shape == "rectangle" and not edge:
        raise ValueError("a beam of rectangular section can be pushed by one edge alone")
    resting = rest(rod, intervals)
    problem = RodContactProblem(rod, motor, tuple(obstacles), resting.tip / rod.beam.length)
    onset = first_contact(problem, contact_distance)
    previous, before = onset, None
    states = []
    for number, step in enumerate(steps, start=1):
        try:
            if step.size <= 0 or _short_of_wall(problem, step):
                untouched = free(problem, step)
                _check_clearance(untouched)
                states.append(untouched.state(intervals))
                previous, before = onset, None
                continue
            if obstacles[0].friction:
                previous, before = slide(problem, step, contact_distance, resting, previous, before)
            else:
                before = continue_from_first_contact(problem, step, contact_distance, resting)
            _check_outside(problem, before)
            check(before)
        except EquilibriumError as error:
            if len(steps) == 1:
                raise
            raise EquilibriumError(f"in step {number}, {error}") from error
        states.append(before.state(intervals))
    return states


def _short_of_wall(problem: RodContactProblem, step: Step) -> bool:
    """Test whether the beam has not yet turned far enough for its tip to reach a wall."""
    if not isinstance(problem.obstacles[0].surface, Flat):
        return False
    _, depth, _ = deepest(free(problem, step), 0)
    return depth <= 0


def _check_clearance(untouched: Equilibrium) -> None:
    """Raise EquilibriumError if a beam before contact is inside one of the objects."""
    radius = untouched.problem.rod.beam.radius
    for index, obstacle in enumerate(untouched.problem.obstacles):
        surface = obstacle.surface
        if isinstance(surface, Line | Ball):
            s, depth, normal = deepest(untouched, index)
            outward = untouched.clamp_from_world[:3, :3] @ obstacle.world_from_object[:3, 1]
            if surface.radius > 0 and normal @ outward < 0:
                raise EquilibriumError(
                    f"before contact the beam would have passed through obstacle {index + 1}"
                )
            if depth > MAX_DEPTH * radius:
                raise EquilibriumError(
                    f"before contact the beam would lie {depth:.2g} m deep in obstacle "
                    f"{index + 1}, at arc length {s:.4g} m"
                )


def _check_outside(problem: RodContactProblem, solution: Equilibrium) -> None:
    """Raise EquilibriumError if the beam passes through one of `problem`'s meshes."""
    _, states, _ = solution.traced(SCAN)
    for index, obstacle in enumerate(problem.obstacles):
        if isinstance(obstacle.surface, Solid):
            line = in_object(solution, index, states[:, :3] * problem.rod.beam.length)
            if obstacle.surface.holds(line):
                raise EquilibriumError(TWO_EDGES)
