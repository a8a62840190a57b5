"""Coulomb friction: a contact sticks where friction can hold it, and slides otherwise.

Friction depends on the path, so a push is followed in short steps. Their direction of sliding is
that of a backward difference of order 2.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from vbaa_bench.mechanics.contact import PreviousContact
from vbaa_bench.mechanics.contact_checks import SCAN
from vbaa_bench.mechanics.continuation import continue_from_first_contact, free
from vbaa_bench.mechanics.rod_contact import Equilibrium, RodContactProblem, Step
from vbaa_bench.mechanics.state import EquilibriumError, State

# Largest short step: pushing angle [rad], or deflection over L.
FRICTION_STRIDE = 0.04


def first_contact(problem: RodContactProblem, contact_distance: float) -> PreviousContact:
    """Find the touched point at first contact: an inclined section does not touch at its middle."""
    first, length = problem.obstacles[0], problem.rod.beam.length
    if not first.friction:
        return PreviousContact(contact_distance, np.zeros(3))
    untouched = free(problem, Step(0.0))
    rows, states, _ = untouched.traced(SCAN)
    s = contact_distance / length
    force = first.world_from_object[:3, 1]
    resting = CubicSpline(rows, states)(s)
    # Only the force's direction is used: the object has not yielded yet.
    rigid = replace(problem, obstacles=(replace(first, compliance=0.0), *problem.obstacles[1:]))
    touch = rigid.evaluate(untouched.clamp_from_world, 0, resting, s, force).touch
    return PreviousContact(contact_distance, touch.point)


def slide(
    problem: RodContactProblem,
    step: Step,
    contact_distance: float,
    resting: State,
    previous: PreviousContact,
    before: Equilibrium | None,
) -> tuple[PreviousContact, Equilibrium]:
    """Solve one step with friction in short steps; repeat with finer ones if it is lost.

    A step that repeats the one before changes nothing.
    """
    if before is not None and step == before.step:
        return previous, before
    start = step.part(0.0) if before is None else before.step
    count = max(int(np.ceil(abs(step.size - start.size) / FRICTION_STRIDE)), 1)
    for finer in (1, 3, 9):
        last_contact, solution = previous, before
        try:
            for fraction in np.arange(1, finer * count + 1) / (finer * count):
                last, part = solution, step.since(start, float(fraction))
                solution = _stick_or_slide(
                    problem, part, contact_distance, resting, last_contact, last
                )
                last_contact = _next_contact(last_contact, last, solution)
        except EquilibriumError as error:
            failure = error
        else:
            assert solution is not None
            return last_contact, solution
    raise failure


def _solve_near(before: Equilibrium, step: Step, previous: PreviousContact) -> Equilibrium:
    """Solve for the equilibrium near `before`, with its first contact held according to `previous`.

    Raises EquilibriumError if there is none, if it is behind the object, where the beam cannot
    get, or if the object would have to pull.
    """
    engaged = {**dict.fromkeys(before.contacts), 0: previous}
    solution = before.problem.solve(step, engaged, before.unknown)
    contact = solution.contacts[0]
    outward = (
        solution.clamp_from_world[:3, :3] @ solution.problem.obstacles[0].world_from_object[:3, 1]
    )
    if contact.touch.normal @ outward <= 0:
        raise EquilibriumError("the beam would have passed through the object")
    if contact.force @ contact.touch.normal <= 0:
        raise EquilibriumError(f"contact is lost: the object would pull at {contact.s:.4g} m")
    return solution


def _next_contact(
    previous: PreviousContact, last: Equilibrium | None, solution: Equilibrium
) -> PreviousContact:
    """Return the contact as the next step needs it: where it is, and how it slid there."""
    contact = solution.contacts[0]
    clamp_from_object = solution.clamp_from_world @ solution.problem.obstacles[0].world_from_object
    along = clamp_from_object[:3, :3].T @ contact.section[6:9]
    slid = contact.touch.point - previous.point - (contact.s - previous.s) * along
    start = 0.0 if last is None else last.step.size
    return PreviousContact(contact.s, contact.touch.point, slid, pace=solution.step.size - start)


def _stick_or_slide(
    problem: RodContactProblem,
    step: Step,
    contact_distance: float,
    resting: State,
    previous: PreviousContact,
    before: Equilibrium | None,
) -> Equilibrium:
    """Solve one short step with friction: the contact slides, or it sticks."""
    friction = problem.obstacles[0].friction
    if before is None:
        return _solve_near(
            continue_from_first_contact(problem, step, contact_distance, resting), step, previous
        )
    # Only the object has moved in a step of no size: the path starts anew.
    ratio = (step.size - before.step.size) / previous.pace if previous.pace else 0.0
    onward = replace(previous, ratio=max(ratio, 0.0))  # after a reversal the path starts anew
    if ratio > 0:
        try:
            return _solve_near(before, step, onward)
        except EquilibriumError:
            pass  # it sticks, or its last state is too far away to start from
    try:
        stuck = _solve_near(before, step, replace(previous, sticks=True))
    except EquilibriumError:
        pass  # there is no equilibrium that sticks
    else:
        contact = stuck.contacts[0]
        if contact.touch.slope <= friction:
            return stuck
        # Friction cannot hold it: it slides along the sticking force, whatever its last direction.
        normal = contact.touch.normal
        drag = contact.force - (contact.force @ normal) * normal
        try:
            yielding = _solve_near(stuck, step, replace(previous, drag=drag))
            return _solve_near(yielding, step, replace(previous, ratio=0.0))
        except EquilibriumError:
            pass  # it slides too far from this start
    return _solve_near(
        continue_from_first_contact(problem, step, contact_distance, resting), step, onward
    )
