"""Frictionless equilibrium by continuation from first contact, which starts from linear theory.

The strides are short enough to extrapolate from the last two equilibria. On the way the beam may
roll from one edge of a mesh to the next, and meet further objects.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE
from vbaa_bench.mechanics.contact_checks import (
    MAX_DEPTH,
    SCAN,
    check_all_on_beam,
    check_pushed,
    deepest,
    nearest,
    smooth,
)
from vbaa_bench.mechanics.rod_contact import Equilibrium, RodContactProblem, Step
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.mechanics.surfaces import Flat, Surface

# Largest continuation stride: pushing angle [rad], or deflection over L.
STRIDE = 0.06
# Largest stride where the beam may meet a second object: a longer one could jump over it.
SHORT_STRIDE = 0.005
# Factors of the number of strides, tried in turn.
FINER = (1, 2, 4, 16)
# Largest ratio of a force to that in proportion to the stride before. Measured on tapered beams: it
# is up to 1.3 on the way from first contact, and 4 to 6 after a jump to another equilibrium.
MAX_FORCE_RATIO = 2.0
TWO_EDGES = (
    "the beam rests on two edges or corners of the mesh at once: "
    "a finer mesh or another angle is needed"
)


def free(problem: RodContactProblem, step: Step) -> Equilibrium:
    """Solve for the beam at a step at which it touches nothing."""
    turned = problem.motor.clamp_from_world(step.size, step.drift)[:3, :3]
    moment = problem.rod.weight_moment(turned)
    return problem.solve(step, {}, np.array([*moment, step.size]))


def continue_from_first_contact(
    problem: RodContactProblem, step: Step, contact_distance: float, resting: State
) -> Equilibrium:
    """Find the frictionless equilibrium; repeat with finer strides if continuation fails."""
    stride = STRIDE if len(problem.obstacles) == 1 else SHORT_STRIDE
    strides = int(np.ceil(step.size / stride))
    if isinstance(problem.obstacles[0].surface, Flat):
        strides = 1  # the contact with a wall starts far beyond the tip
    for finer in FINER:
        try:
            return _follow(problem, step, contact_distance, resting, finer * strides)
        except EquilibriumError as error:
            failure = error
    raise failure


def _follow(
    problem: RodContactProblem, step: Step, contact_distance: float, resting: State, strides: int
) -> Equilibrium:
    """Follow the frictionless equilibrium from first contact in even strides."""
    current = smooth(problem, np.eye(4), resting.centreline[:, 1:])
    path: list[Equilibrium] = []
    for fraction in np.arange(1, strides + 1) / strides:
        part = step.part(float(fraction))
        if not path:
            start = _linear(problem, part, contact_distance, resting)
            solution = current.solve(part, {0: None}, start)
            # A deflection has a size only: its mirror image, in which the object pulls, has it too.
            check_pushed(solution)
            force = start[4:7]
        else:
            start = path[-1].unknown
            force = start[4:7] * (len(path) + 1) / len(path)
            if len(path) > 1 and _alike(path[-2], path[-1]):
                start = 2 * start - path[-2].unknown
            solution = current.solve(part, dict.fromkeys(path[-1].contacts), start)
        if problem.rod.tip_ratio < 1:
            _check_branch(solution, float(np.linalg.norm(force)))
        check_all_on_beam(solution)  # a solution beyond the tip may be of another branch
        solution = _rolled_on(problem, _with_new_contact(solution))
        current = solution.problem
        path.append(solution)
    return path[-1]


def _check_branch(solution: Equilibrium, expected: float) -> None:
    """Raise EquilibriumError if the first contact's force is far from the `expected` one.

    A beam with a thin tip has further equilibria, in which it is bent to an S or rolled up.
    """
    ratio = float(np.linalg.norm(solution.unknown[4:7])) / expected
    if not 1 / MAX_FORCE_RATIO < ratio < MAX_FORCE_RATIO:
        raise EquilibriumError(f"no equilibrium near that of a smaller step (force x {ratio:.2g})")


def _rolled_on(problem: RodContactProblem, solution: Equilibrium) -> Equilibrium:
    """Move contacts to the edge or corner of `problem`'s meshes onto which the beam has rolled."""
    tried: list[list[Surface]] = []
    while True:
        _, states, _ = solution.traced(SCAN)
        shift = solution.contacts[0].touch.shift  # only the first object may yield
        line = states[:, :3] * problem.rod.beam.length - shift
        smoothed = smooth(problem, solution.clamp_from_world, line)
        if _surfaces(smoothed) == _surfaces(solution.problem):
            return solution
        tried.append(_surfaces(solution.problem))
        start = solution.unknown.copy()
        try:
            for i, index in enumerate(solution.contacts):
                surface = smoothed.obstacles[index].surface
                if surface is not solution.problem.obstacles[index].surface:
                    start[7 + 4 * i] = nearest(solution, index, surface) / problem.rod.beam.length
            if _surfaces(smoothed) in tried:
                raise EquilibriumError("it alternates between edges")
            solution = smoothed.solve(solution.step, dict.fromkeys(solution.contacts), start)
        except (EquilibriumError, ValueError) as error:  # a trial contact beyond the beam's ends
            raise EquilibriumError(TWO_EDGES) from error


def _alike(first: Equilibrium, second: Equilibrium) -> bool:
    """Test whether two equilibria have the same surfaces and contacts, to extrapolate from them."""
    same = _surfaces(first.problem) == _surfaces(second.problem)
    return same and list(first.contacts) == list(second.contacts)


def _surfaces(problem: RodContactProblem) -> list[Surface]:
    """List the surfaces that the beam may touch; each is equal only to itself."""
    return [obstacle.surface for obstacle in problem.obstacles]


def _with_new_contact(solution: Equilibrium) -> Equilibrium:
    """Add a contact with one further object if the beam has entered it."""
    beam = solution.problem.rod.beam
    for index in range(len(solution.problem.obstacles)):
        if index in solution.contacts:
            continue
        s, depth, normal = deepest(solution, index)
        if depth > MAX_DEPTH * beam.radius:
            position, relative_depth = s / beam.length, depth / beam.length
            start = np.concatenate(
                [solution.unknown, 3 * relative_depth / position**3 * normal, [position]]
            )
            engaged = dict.fromkeys([*solution.contacts, index])
            return solution.problem.solve(solution.step, engaged, start)
    return solution


def _linear(
    problem: RodContactProblem, step: Step, contact_distance: float, resting: State
) -> Floats:
    """Estimate the unknowns by linear theory, (9) and (10): F = 3 EI y_c / x_c^3.

    A linear taper to a section of size b at the contact makes the force b times as large and the
    slope there (2 b + 1) / 3 b times as steep, at the same y_c.
    """
    first, rod = problem.obstacles[0], problem.rod
    length = rod.beam.length
    x_0 = contact_distance / length
    b = 1 + (rod.tip_ratio - 1) * x_0
    give = 3 * b * first.compliance * rod.force_unit / length
    angle = step.size
    if step.deflection is not None:
        y_c = step.deflection * 2 * b * x_0 / (2 * b + 1 - x_0)
        angle = float(np.arctan(y_c * (1 + give / x_0**3) / x_0))
    normal, position = first.world_from_object[:3, 1], first.world_from_object[:3, 3]
    if isinstance(first.surface, Flat):  # its distance from the wall is gap (1 - x / x_c)^3
        gap = -float(position @ normal + rod.beam.radius) / length
        x_0 = 3 * gap / angle
        if x_0 >= 1:
            raise EquilibriumError(
                f"the beam lies along the wall from {x_0 * length:.4g} m on, allowed is before the "
                f"tip at {length:.4g} m: it must turn by more than {3 * gap / DEGREE:.4g} degrees"
            )
        force = 6 * gap / x_0**3 * normal
    else:
        world = problem.motor.clamp_from_world(angle, step.drift)
        displacement = (world[:3, :3] @ position + world[:3, 3] - position) @ normal / length
        force = 3 * b * displacement / (x_0**3 + give) * normal
        x_0 += step.drift[0] / length
    arm = np.array([x_0, 0.0, 0.0])
    if any(rod.bow):
        arm = (
            CubicSpline(resting.centreline[:, 0], resting.centreline[:, 1:])(x_0 * length) / length
        )
    moment = np.cross(arm, force) - resting.base_moment / (rod.force_unit * length)
    return np.array([*moment, angle, *force, x_0])
