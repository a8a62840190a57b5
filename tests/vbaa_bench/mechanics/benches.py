"""What the proofs of this room share: beams, edges, and statics written down once more."""

import math
from itertools import pairwise

import numpy as np
from scipy.integrate import simpson
from scipy.interpolate import CubicSpline

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from solver.instrument.transforms import rigid
from tests.oracle import EI
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.pushing import push
from vbaa_bench.mechanics.rod import POISSON, Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import State
from vbaa_bench.mechanics.surfaces import Surface, upright

BEAM = Beam(0.24, 0.8e-3, EI)
THIN = Beam(0.24, 2e-5, EI)  # small-deflection theory knows no radius
STEEL = 7930 * 9.81 * math.pi * BEAM.radius**2  # weight [N/m]
CLAMP = Motor()


def leaning(nu: float) -> Floats:
    """Unit vector (3,) that leans by `nu` [rad] from y towards z."""
    return np.array([0.0, math.cos(nu), math.sin(nu)])


def obstacle(
    beam: Beam | Rod,
    x_0: float,
    surface: Surface | None = None,
    *,
    nu: float = 0.0,
    compliance: float = 0.0,
    friction: float = 0.0,
    clearance: float = 0.0,
) -> Obstacle:
    """An object, an edge unless told, that the straight beam touches at `x_0` [m]; turned about
    the beam by `nu` [rad], giving way along its normal."""
    rod = beam if isinstance(beam, Rod) else Rod(beam)
    place = np.array([x_0, 0.0, 0.0]) - (rod.reach(x_0, nu) + clearance) * leaning(nu)
    return Obstacle(
        surface or upright(),
        rigid([nu, 0.0, 0.0], place),
        compliance=compliance,
        spring=leaning(nu),
        friction=friction,
    )


def push_one(
    rod: Rod,
    touched: Obstacle,
    x_0: float,
    *,
    angle: float | None = None,
    deflection: float | None = None,
    motor: Motor = CLAMP,
    intervals: int = 480,
) -> State:
    step = Step(pushing_angle=angle, deflection=deflection)
    return push(rod, motor, [touched], x_0, [step], intervals)[0]


def orders(errors: list[float]) -> Floats:
    """Observed orders, the cause having been halved from one error to the next."""
    return np.asarray(np.log2(np.array(errors[:-1]) / np.array(errors[1:])))


def imbalance(state: State, weight: Floats) -> float:
    """What forces and moments leave, relative to the clamp's; `weight` (3,) is in N/m."""
    s, line = state.centreline[:, 0], state.centreline[:, 1:]
    marks = [0, *sorted(one.row for one in state.contacts), len(s) - 1]
    mean = sum(
        (simpson(line[a : b + 1], x=s[a : b + 1], axis=0) for a, b in pairwise(marks)),
        np.zeros(3),
    )
    force = state.base_force + sum((c.force for c in state.contacts), s[-1] * weight)
    moment = state.base_moment + np.cross(mean, weight)
    for one in state.contacts:
        moment = moment + np.cross(one.point + one.lever, one.force)
    return float(
        max(
            np.abs(force).max() / np.linalg.norm(state.base_force),
            np.abs(moment).max() / np.linalg.norm(state.base_moment),
        )
    )


def energy(state: State, weight: Floats, world_from_clamp: Floats) -> float:
    """Energy [J] of bending, twisting and height of a round beam, `weight` (3,) [N/m] in the world.

    From the moments alone that hold each piece of the beam in balance.
    """
    s, line = state.centreline[:, 0], state.centreline[:, 1:]
    row, contact = state.contact.row, state.contact
    pull = world_from_clamp[:3, :3].T @ weight
    total = 0.0
    # Of what hangs beyond each row: its length and its mean place, from the tip backwards.
    areas = [
        CubicSpline(s[a:b], line[a:b]).antiderivative() for a, b in ((0, row + 1), (row, None))
    ]
    beyond = areas[1](s[-1]) - areas[1](s[row:])
    before = areas[0](s[row]) - areas[0](s[: row + 1]) + beyond[0]
    for i, (here, sums) in enumerate(((slice(0, row + 1), before), (slice(row, None), beyond))):
        moment = np.cross(sums - (s[-1] - s[here])[:, None] * line[here], pull)
        if i == 0:
            moment = moment + np.cross(contact.point - line[here], contact.force)
        tangent = CubicSpline(s[here], line[here])(s[here], 1)
        twisting = (moment * tangent).sum(axis=1)
        bending = (moment**2).sum(axis=1) - twisting**2
        density = (bending + (1 + POISSON) * twisting**2) / (2 * EI)
        height = line[here] @ world_from_clamp[:3, :3].T + world_from_clamp[:3, 3]
        total += float(simpson(density - height @ weight, x=s[here]))
    return total
