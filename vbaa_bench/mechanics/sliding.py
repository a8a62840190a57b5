"""Coulomb friction: a contact slides where it must, and sticks where friction holds it.

Friction depends on the way, so a push is followed in short steps whose direction of sliding is that
of a backward difference of order 2.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from vbaa_bench.mechanics.bench import Bench, Equilibrium, Step
from vbaa_bench.mechanics.contact import Grip
from vbaa_bench.mechanics.following import free, reach
from vbaa_bench.mechanics.meeting import SCAN
from vbaa_bench.mechanics.state import EquilibriumError, State

# How far a step goes at most: radians of pushing, or deflection over L.
FRICTION_STRIDE = 0.04


def first_grip(bench: Bench, contact_distance: float) -> Grip:
    """Where beam and object touch at first contact: not in the middle of a leaning section."""
    first, length = bench.obstacles[0], bench.rod.beam.length
    if not first.friction:
        return Grip(contact_distance, np.zeros(3))
    untouched = free(bench, Step(0.0))
    rows, states, _ = untouched.traced(SCAN)
    s = contact_distance / length
    force = first.world_from_object[:3, 1]
    resting = CubicSpline(rows, states)(s)
    touched = bench.trial(untouched.clamp_from_world, 0, resting, s, force).touch
    return Grip(contact_distance, touched.point)


def slide(
    bench: Bench,
    step: Step,
    contact_distance: float,
    resting: State,
    grip: Grip,
    before: Equilibrium | None,
) -> tuple[Grip, Equilibrium]:
    """One step with friction, in short ones that its direction can follow; finer if it is lost."""
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


def _next_grip(grip: Grip, last: Equilibrium | None, now: Equilibrium) -> Grip:
    """What the next step has to know of this one: where the contact is, and how it slid there."""
    contact = now.contacts[0]
    clamp_from_object = now.clamp_from_world @ now.bench.obstacles[0].world_from_object
    along = clamp_from_object[:3, :3].T @ contact.section[6:9]
    slid = contact.touch.point - grip.point - (contact.s - grip.s) * along
    start = 0.0 if last is None else last.step.size
    return Grip(contact.s, contact.touch.point, slid, pace=now.step.size - start)


def _settle(
    bench: Bench,
    step: Step,
    contact_distance: float,
    resting: State,
    grip: Grip,
    before: Equilibrium | None,
) -> Equilibrium:
    """One short step with friction: where it slides to, or where it is still held."""
    friction = bench.obstacles[0].friction
    if before is None:
        found = reach(bench, step, contact_distance, resting)
        sliding = {**dict.fromkeys(found.contacts), 0: grip}
        return found.bench.solve(step, sliding, found.unknown)
    ratio = (step.size - before.step.size) / grip.pace
    onward = replace(grip, ratio=max(ratio, 0.0))  # after a turn the way begins anew
    if ratio > 0:
        try:
            sliding = {**dict.fromkeys(before.contacts), 0: onward}
            return before.bench.solve(step, sliding, before.unknown)
        except EquilibriumError:
            pass  # it sticks, or has gone too far for its last state to lead there
    try:
        held = {**dict.fromkeys(before.contacts), 0: replace(grip, sticks=True)}
        stuck = before.bench.solve(step, held, before.unknown)
    except EquilibriumError:
        pass  # friction has nothing to hold there
    else:
        if stuck.contacts[0].touch.slope <= friction:
            return stuck
    found = reach(bench, step, contact_distance, resting)
    sliding = {**dict.fromkeys(found.contacts), 0: onward}
    return found.bench.solve(step, sliding, found.unknown)
