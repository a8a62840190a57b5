"""Closest points of a bent beam and the objects about it, and checks of its contacts."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, invert
from vbaa_bench.mechanics.rod_contact import Equilibrium, RodContactProblem
from vbaa_bench.mechanics.state import EquilibriumError, check_on_beam
from vbaa_bench.mechanics.surfaces import Ball, Line, Surface

# Depth in an object, over the beam's radius, above which the beam counts as touching it.
MAX_DEPTH = 1e-3
# Number of segments of the beam whose ends are tested for their distance to an object.
SCAN = 120


def smooth(
    problem: RodContactProblem, clamp_from_world: Floats, centreline: Floats
) -> RodContactProblem:
    """Reduce every mesh of a problem to its edge or corner nearest to a `centreline` (n, 3) [m].

    The centreline is in the clamp's frame; `clamp_from_world` is (4, 4).
    """
    obstacles = []
    for obstacle in problem.obstacles:
        object_from_clamp = invert(clamp_from_world @ obstacle.world_from_object)
        surface = obstacle.surface.touched_by(apply(object_from_clamp, centreline))
        obstacles.append(replace(obstacle, surface=surface))
    return replace(problem, obstacles=tuple(obstacles))


class DeepestPlace(NamedTuple):
    """Arc length [m], depth [m] in an obstacle and normal (3,); clearance is negative depth."""

    s: float
    depth: float
    normal: Floats


def deepest(found: Equilibrium, index: int) -> DeepestPlace:
    """Find where the beam comes nearest to an obstacle or is deepest in it."""
    problem = found.problem
    rows, states, _ = found.traced(SCAN)
    s = nearest(found, index, problem.obstacles[index].surface) / problem.rod.beam.length
    force = np.zeros(3)
    if index in found.contacts:  # the force sets how far the object has yielded
        force = found.contacts[index].force / problem.rod.force_unit
    guess = problem.evaluate(found.clamp_from_world, index, CubicSpline(rows, states)(s), s, force)
    depth = -float(guess.touch.errors[0]) * problem.rod.beam.length
    return DeepestPlace(guess.s, depth, guess.touch.normal)


def nearest(found: Equilibrium, index: int, surface: Surface) -> float:
    """Find the arc length [m] where the beam is nearest to `surface`, a part of an obstacle."""
    rows, states, _ = found.traced(SCAN)
    length = found.problem.rod.beam.length
    line = in_object(found, index, states[:, :3] * length)
    curve = CubicSpline(rows, line)

    def distance_to(point: Floats) -> float:
        distance, _ = surface.distance(point)
        # The distance from an edge, or a cylinder's axis, is positive on both sides.
        return abs(distance + surface.radius) if isinstance(surface, Line | Ball) else distance

    coarse = int(np.argmin([distance_to(point) for point in line]))
    bracket = rows[max(coarse - 1, 0)], rows[min(coarse + 1, SCAN)]
    best = minimize_scalar(
        lambda s: distance_to(curve(s)), method="bounded", bounds=bracket, options={"xatol": 1e-9}
    )
    at_row = float(rows[coarse])
    return (float(best.x) if best.fun < distance_to(line[coarse]) else at_row) * length


def in_object(found: Equilibrium, index: int, points: Floats) -> Floats:
    """Transform points (n, 3) [m] of the clamp's frame to that of an obstacle, which yields."""
    shift = found.contacts[index].touch.shift if index in found.contacts else np.zeros(3)
    clamp_from_object = found.clamp_from_world @ found.problem.obstacles[index].world_from_object
    return apply(invert(clamp_from_object), points - shift)


def check_all_on_beam(found: Equilibrium) -> None:
    """Raise EquilibriumError if a contact is beyond the tip."""
    for guess in found.contacts.values():
        check_on_beam(guess.s, found.problem.rod.beam.length)


def check_pushed(found: Equilibrium) -> None:
    """Raise EquilibriumError if an object pulls the beam."""
    for guess in found.contacts.values():
        if guess.force @ guess.touch.normal <= 0:
            raise EquilibriumError(
                f"contact is lost: the object would have to pull the beam at {guess.s:.4g} m"
            )


def check(found: Equilibrium) -> None:
    """Raise EquilibriumError if the beam cannot remain in this state.

    It must not slip off at the tip, be pulled, cut into an object, or slip off a ball sideways.
    """
    check_all_on_beam(found)
    check_pushed(found)
    beam = found.problem.rod.beam
    for index, guess in found.contacts.items():
        pressing = float(guess.force @ guess.touch.normal)
        obstacle = found.problem.obstacles[index]
        surface = obstacle.surface
        if isinstance(surface, Line | Ball) and surface.radius == 0:
            continue  # an edge has no inside
        if isinstance(surface, Ball) and obstacle.friction == 0:
            # A shift z aside inclines the force by z / (R + r); the beam resists by 3 EI z / x_c^3.
            allowed = surface.radius + beam.radius
            bend = pressing * guess.s**3 / (3 * beam.flexural_rigidity)
            if bend > allowed:
                raise EquilibriumError(
                    f"the beam would slip off the sphere sideways: bent by {bend:.4g} m at the "
                    f"contact, allowed is up to the radii's sum, {allowed:.4g} m"
                )
        s, depth, _ = deepest(found, index)
        if depth > MAX_DEPTH * beam.radius:
            raise EquilibriumError(
                f"the beam would cut {depth:.2g} m into the object at arc length {s:.4g} m"
            )
