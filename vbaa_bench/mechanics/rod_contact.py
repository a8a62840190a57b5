"""Equations of a rod whose clamp is turned by a motor, in contact with obstacles.

In the clamp's frame the clamp is fixed, and the world turns about the motor's axis by the
pushing angle. The unknowns are the clamp's moment, the pushing angle, and the force and arc
length of every contact. The equations of each contact (`contact.py`) must hold, and the moment
at the tip must be zero. MINPACK's hybrid method (Powell 1970) solves for all unknowns at once.
They are in the rod's units: lengths in L, forces in EI / L^2.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import root

from solver.instrument.arrays import Floats
from vbaa_bench.mechanics.contact import Obstacle, PreviousContact, Touch, touch
from vbaa_bench.mechanics.rod import ORDER, Rod, advance, cross, trace
from vbaa_bench.mechanics.state import Contact, EquilibriumError, State, check_residual


@dataclass(frozen=True)
class Motor:
    """Motor shaft: a point (3,) [m] of its axis in the clamp's frame, and the axis's direction."""

    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def clamp_from_world(self, angle: float, drift: tuple[float, float, float]) -> Floats:
        """Return the transform (4, 4) from world to clamp after a turn by `angle` [rad].

        The objects have meanwhile moved by `drift` (3,) [m] in the world.
        """
        x, y, z = self.direction
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        point = np.array(self.point)
        turn = np.eye(4)
        # Rodrigues' formula; evaluated at every iteration of the solver.
        turn[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)
        turn[:3, 3] = point + turn[:3, :3] @ (np.array(drift) - point)
        return turn


@dataclass(frozen=True)
class Step:
    """Target of one state of a push: a pushing angle [rad] or a tip deflection.

    `deflection` is the tip's displacement across the beam over the beam's length. Exactly one of
    the two is None. The objects have moved by `drift` (3,) [m].
    """

    pushing_angle: float | None = None
    deflection: float | None = None
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if (self.pushing_angle is None) == (self.deflection is None):
            raise ValueError("give one of deflection and pushing_angle")
        if self.deflection is not None and self.deflection < 0:
            raise ValueError(f"deflection is {self.deflection}, allowed is 0 and more")

    @property
    def size(self) -> float:
        """Pushing angle [rad] or deflection, whichever is set."""
        return (self.deflection or 0.0) if self.pushing_angle is None else self.pushing_angle

    def part(self, share: float) -> "Step":
        """Scale the step to a `share` of its size and drift."""
        return Step(
            None if self.pushing_angle is None else share * self.pushing_angle,
            None if self.deflection is None else share * self.deflection,
            (share * self.drift[0], share * self.drift[1], share * self.drift[2]),
        )

    def since(self, before: "Step", share: float) -> "Step":
        """Interpolate from the step `before` (share 0) to this step (share 1)."""
        size = before.size + share * (self.size - before.size)
        (x, y, z), (u, v, w) = before.drift, self.drift
        return Step(
            None if self.pushing_angle is None else size,
            None if self.deflection is None else size,
            (x + share * (u - x), y + share * (v - y), z + share * (w - z)),
        )


@dataclass(frozen=True)
class ContactGuess:
    """Contact at trial values of the unknowns.

    `s` is its arc length [m], `force` (3,) [N], and `section` the rod's state (12,) there, with
    its position in metres.
    """

    s: float
    force: Floats
    section: Floats
    touch: Touch


@dataclass(frozen=True)
class RodContactProblem:
    """Contact problem of rod, motor and obstacles; `free_tip` (3,) is the tip at rest over L."""

    rod: Rod
    motor: Motor
    obstacles: tuple[Obstacle, ...]
    free_tip: Floats

    def solve(
        self, step: Step, engaged: Mapping[int, PreviousContact | None], start: Floats
    ) -> "Equilibrium":
        """Find the equilibrium nearest to the unknowns `start`, touching the `engaged` obstacles.

        `engaged` maps each obstacle's index to its previous contact; None makes it frictionless.
        Raises EquilibriumError if there is none.
        """
        scale = np.abs(start)
        for first, last in ((0, 3), *((i, i + 3) for i in range(4, len(start), 4))):
            scale[first:last] = np.linalg.norm(start[first:last])  # one scale per vector
        scale[scale == 0] = 1.0
        weight = np.ones(len(start))
        weight[:3] = scale[:3]
        steps = self.rod.steps

        def errors(scaled: Floats) -> Floats:
            return self._errors(step, engaged, start + (scaled - 1) * scale, steps)[0] / weight

        try:
            # Trial values may overflow; a residual that is not finite is an error below.
            with np.errstate(over="ignore", invalid="ignore"):
                # Offset by 1: MINPACK varies unknowns by a fraction of themselves; some are zero.
                solution = root(errors, np.ones(len(start)), method="hybr", options={"xtol": 1e-14})
                unknown = start + (solution.x - 1) * scale
                final, contacts, tip = self._errors(step, engaged, unknown, steps)
                # Repeat with half the steps to estimate the integration error.
                coarse, _, _ = self._errors(step, engaged, unknown, steps // 2)
        except (ValueError, ArithmeticError) as error:
            raise EquilibriumError(f"no equilibrium ({error})") from error
        # Errors of lengths and angles are relative to the tip's displacement from rest.
        displacement = min(float(np.linalg.norm(tip - self.free_tip)) or 1.0, 1.0)
        weight[3] = displacement
        for first in range(4, len(start), 4):
            weight[first] = displacement
            # This angle error moves the closest point along the beam by the angle times the radius.
            weight[first + 1] = self.rod.beam.length / self.rod.beam.radius
        misfit, truncation = np.abs(final / weight).max(), np.abs((final - coarse) / weight).max()
        residual = float(max(misfit, truncation / (2**ORDER - 1)))
        check_residual(residual, "no equilibrium")
        return Equilibrium(self, step, unknown, contacts, tip, residual)

    def evaluate(
        self,
        clamp_from_world: Floats,
        index: int,
        state: Floats,
        s: float,
        force: Floats,
        previous: PreviousContact | None = None,
    ) -> ContactGuess:
        """Evaluate a contact with obstacle `index` at `s`: `force` (3,), rod `state` (12,)."""
        length, newtons = self.rod.beam.length, force * self.rod.force_unit
        section = state.copy()
        section[:3] *= length
        evaluated = touch(
            self.rod,
            self.obstacles[index],
            clamp_from_world,
            section,
            s * length,
            newtons,
            previous,
        )
        return ContactGuess(s * length, newtons, section, evaluated)

    def couple(self, guess: ContactGuess) -> Floats:
        """Compute the moment (3,) of a contact's force about the centreline."""
        moment = cross(guess.touch.lever, guess.force)
        return np.asarray(moment / (self.rod.force_unit * self.rod.beam.length))

    def _errors(
        self, step: Step, engaged: Mapping[int, PreviousContact | None], unknown: Floats, steps: int
    ) -> tuple[Floats, dict[int, ContactGuess], Floats]:
        """Compute the residuals, in the order of the unknowns, with the contacts and the tip."""
        world = self.motor.clamp_from_world(float(unknown[3]), step.drift)
        properties = self.rod.properties(world[:3, :3])
        forces, stops = unknown[4:].reshape(-1, 4)[:, :3], unknown[7::4]
        ahead = forces.sum(axis=0)
        state, position = self.rod.clamp(unknown[:3]), 0.0
        contacts: dict[int, ContactGuess] = {}
        errors = np.zeros(len(unknown))
        indices = list(engaged)
        for i in np.argsort(stops):
            index, s = indices[i], float(stops[i])
            state = advance(state, position, s, _step_count(steps, s - position), ahead, properties)
            guess = self.evaluate(world, index, state, s, forces[i], engaged[index])
            contacts[index] = guess
            errors[4 + 4 * i : 8 + 4 * i] = guess.touch.errors
            state[9:] -= self.couple(guess)
            ahead, position = ahead - forces[i], s
        left = state[9:].copy()
        if self.rod.loose_tip:
            # A moment that trial values leave would roll up the thin end.
            state[9:] = 0.0
        tip = advance(state, position, 1.0, _step_count(steps, 1.0 - position), ahead, properties)
        errors[:3] = left if self.rod.loose_tip else tip[9:]
        if step.pushing_angle is not None:
            errors[3] = unknown[3] - step.size
        else:
            across = tip[1:3] - self.free_tip[1:]
            errors[3] = np.sqrt(across @ across) - step.size
        # Sort the contacts as in `engaged`, which is the order of the unknowns.
        return errors, {index: contacts[index] for index in indices}, tip[:3]


class TracedRod(NamedTuple):
    """Rod from clamp to tip: arc lengths (n,) and states (n, 12), both with lengths in L.

    `contact_rows` are the rows of the contacts, by the index of the obstacle.
    """

    rows: Floats
    states: Floats
    contact_rows: dict[int, int]


@dataclass(frozen=True)
class Equilibrium:
    """Solution of one step: the unknowns, the contacts, the tip (3,), the worst relative error."""

    problem: RodContactProblem
    step: Step
    unknown: Floats
    contacts: dict[int, ContactGuess]
    tip: Floats
    residual: float

    @property
    def angle(self) -> float:
        """Pushing angle [rad]."""
        return float(self.unknown[3])

    @property
    def clamp_from_world(self) -> Floats:
        """Transform (4, 4) from world to clamp."""
        return self.problem.motor.clamp_from_world(self.angle, self.step.drift)

    def traced(self, intervals: int) -> TracedRod:
        """Sample the rod in `intervals` + 1 rows, one of them at every contact."""
        rod = self.problem.rod
        order = sorted(self.contacts, key=lambda index: self.contacts[index].s)
        guesses = [self.contacts[index] for index in order]
        ends = np.array([0.0, *(guess.s / rod.beam.length for guess in guesses), 1.0])
        marks = np.clip(np.rint(ends * intervals).astype(int), 2, intervals - 2)
        marks[0], marks[-1] = 0, intervals
        segments = [
            np.linspace(ends[i], ends[i + 1], marks[i + 1] - marks[i] + 1)[1:]
            for i in range(len(marks) - 1)
        ]
        rows = np.concatenate([[0.0], *segments])
        states = trace(
            rod.clamp(self.unknown[:3]),
            ends[1:-1],
            np.array([guess.force / rod.force_unit for guess in guesses]).reshape(-1, 3),
            np.array([self.problem.couple(guess) for guess in guesses]).reshape(-1, 3),
            rows,
            rod.properties(self.clamp_from_world[:3, :3]),
            math.ceil(rod.steps / (2 * intervals)),
        )
        return TracedRod(rows, states, dict(zip(order, map(int, marks[1:-1]), strict=True)))

    def state(self, intervals: int) -> State:
        """Convert to the beam's state from clamp to tip, in SI, with a row at every contact."""
        rod = self.problem.rod
        rows, states, contact_rows = self.traced(intervals)
        forces = sum((contact.force for contact in self.contacts.values()), np.zeros(3))
        weight = rod.total_weight(self.clamp_from_world[:3, :3]) * rod.force_unit
        contacts = tuple(
            Contact(
                s=contact.s,
                point=contact.section[:3],
                tangent=contact.section[6:9],
                normal=contact.touch.normal,
                lever=contact.touch.lever,
                force=contact.force,
                object_shift=contact.touch.shift,
                row=contact_rows[index],
                obstacle=index,
            )
            for index, contact in self.contacts.items()
        )
        base_force = -forces - weight
        return State.of_rod(rod, rows, states, self.angle, contacts, base_force, self.residual)


def _step_count(steps: int, stretch: float) -> int:
    """Return the integration steps for a stretch of the beam, given `steps` for the whole."""
    return max(round(steps * abs(stretch)), steps // 4)
