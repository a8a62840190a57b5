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


def first_grip(bench: RodContactProblem, contact_distance: float) -> PreviousContact:
    """Find the touched point at first contact: an inclined section does not touch at its middle."""
    first, length = bench.obstacles[0], bench.rod.beam.length
    if not first.friction:
        return PreviousContact(contact_distance, np.zeros(3))
    untouched = free(bench, Step(0.0))
    rows, states, _ = untouched.traced(SCAN)
    s = contact_distance / length
    force = first.world_from_object[:3, 1]
    resting = CubicSpline(rows, states)(s)
    # Only the force's direction is used: the object has not yielded yet.
    unmoved = replace(bench, obstacles=(replace(first, compliance=0.0), *bench.obstacles[1:]))
    touched = unmoved.trial(untouched.clamp_from_world, 0, resting, s, force).touch
    return PreviousContact(contact_distance, touched.point)


def slide(
    bench: RodContactProblem,
    step: Step,
    contact_distance: float,
    resting: State,
    grip: PreviousContact,
    before: Equilibrium | None,
) -> tuple[PreviousContact, Equilibrium]:
    """Solve one step with friction in short steps; repeat with finer ones if it is lost."""
    start = step.part(0.0) if before is None else before.step
    count = max(int(np.ceil(abs(step.size - start.size) / FRICTION_STRIDE)), 1)
    for finer in (1, 3, 9):
        on, now = grip, before
        try:
            for share in np.arange(1, finer * count + 1) / (finer * count):
                last, part = now, step.since(start, float(share))
                now = _settle(bench, part, contact_distance, resting, on, last)
                on = _next_grip(on, last, now)
        except EquilibriumError as error:
            failure = error
        else:
            assert now is not None
            return on, now
    raise failure


def _solved(before: Equilibrium, step: Step, grip: PreviousContact) -> Equilibrium:
    """Solve for the equilibrium near `before`, with its first contact held according to `grip`.

    Raises EquilibriumError if there is none, if it is only behind the object, which no beam can
    continue_from_first_contact, or if the object would have to pull.
    """
    engaged = {**dict.fromkeys(before.contacts), 0: grip}
    found = before.bench.solve(step, engaged, before.unknown)
    contact = found.contacts[0]
    outward = found.clamp_from_world[:3, :3] @ found.bench.obstacles[0].world_from_object[:3, 1]
    if contact.touch.normal @ outward <= 0:
        raise EquilibriumError("the beam would have passed through the object")
    if contact.force @ contact.touch.normal <= 0:
        raise EquilibriumError(f"contact is lost at {contact.s:.4g} m, where nothing pulls")
    return found


def _next_grip(
    grip: PreviousContact, last: Equilibrium | None, now: Equilibrium
) -> PreviousContact:
    """Return the grip for the next step: where the contact is, and how it slid there."""
    contact = now.contacts[0]
    clamp_from_object = now.clamp_from_world @ now.bench.obstacles[0].world_from_object
    along = clamp_from_object[:3, :3].T @ contact.section[6:9]
    slid = contact.touch.point - grip.point - (contact.s - grip.s) * along
    start = 0.0 if last is None else last.step.size
    return PreviousContact(contact.s, contact.touch.point, slid, pace=now.step.size - start)


def _settle(
    bench: RodContactProblem,
    step: Step,
    contact_distance: float,
    resting: State,
    grip: PreviousContact,
    before: Equilibrium | None,
) -> Equilibrium:
    """Solve one short step with friction: the contact slides, or it sticks."""
    friction = bench.obstacles[0].friction
    if before is None:
        return _solved(
            continue_from_first_contact(bench, step, contact_distance, resting), step, grip
        )
    ratio = (step.size - before.step.size) / grip.pace
    onward = replace(grip, ratio=max(ratio, 0.0))  # after a reversal the path starts anew
    if ratio > 0:
        try:
            return _solved(before, step, onward)
        except EquilibriumError:
            pass  # it sticks, or its last state is too far away to start from
    try:
        stuck = _solved(before, step, replace(grip, sticks=True))
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
            yielding = _solved(stuck, step, replace(grip, drag=drag))
            return _solved(yielding, step, replace(grip, ratio=0.0))
        except EquilibriumError:
            pass  # it slides too far from this start
    return _solved(
        continue_from_first_contact(bench, step, contact_distance, resting), step, onward
    )
