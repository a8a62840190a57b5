"""The beam in space: what it shares with the plane, and what it does beside it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from solver.instrument.transforms import invert, rigid
from tests.oracle import EI
from tests.vbaa_bench.mechanics.benches import (
    BEAM,
    STEEL,
    energy,
    imbalance,
    obstacle,
    push_one,
)
from vbaa_bench.mechanics import planar, rod_contact
from vbaa_bench.mechanics.pushing import push, rest
from vbaa_bench.mechanics.rod import Rod, advance
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.mechanics.surfaces import upright

ROD = Rod(BEAM)

x_0s = st.floats(0.02, 0.2)
deflections = st.floats(0.005, 0.25)
softnesses = st.floats(0.0, 2.0)
radii = st.floats(0.0, 0.02)


def in_plane_and_in_space(
    x_0: float, deflection: float, softness: float, radius: float, psi: float
) -> tuple[State, State] | None:
    """The fast path's state, and the core's in a plane turned by `psi`; None where both refuse."""
    compliance = softness * x_0**3 / (3 * EI)
    motor = Motor(direction=(0.0, -math.sin(psi), math.cos(psi)))
    touched = obstacle(BEAM, x_0, upright(radius), nu=psi, compliance=compliance)
    try:
        flat = planar.push(
            BEAM, x_0, deflection=deflection, compliance=compliance, object_radius=radius
        )
    except EquilibriumError:
        with pytest.raises(EquilibriumError):
            push_one(ROD, touched, x_0, deflection=deflection, motor=motor)
        return None
    return flat, push_one(ROD, touched, x_0, deflection=deflection, motor=motor)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(x_0s, deflections, softnesses, radii, st.sampled_from([0.0, 0.0, 0.7, -1.2, 2.5]))
def test_turning_everything_about_the_beam_changes_nothing_but_psi(
    x_0: float, deflection: float, softness: float, radius: float, psi: float
) -> None:
    both = in_plane_and_in_space(x_0, deflection, softness, radius, psi)
    if both is None:
        return
    flat, space = both
    turn = rigid([psi, 0.0, 0.0], np.zeros(3))[:3, :3]
    assert space.contact.psi == pytest.approx(psi, abs=1e-10)
    assert space.contact.s == pytest.approx(flat.contact.s, rel=1e-10)
    assert space.pushing_angle == pytest.approx(flat.pushing_angle, rel=1e-10)
    size = float(np.linalg.norm(flat.contact.force))
    assert turn.T @ space.contact.force == pytest.approx(flat.contact.force, abs=1e-10 * size)
    size = float(np.linalg.norm(flat.base_moment))
    assert turn.T @ space.base_moment == pytest.approx(flat.base_moment, abs=1e-10 * size)
    line = space.centreline[:, 1:] @ turn
    assert line == pytest.approx(flat.centreline[:, 1:], abs=1e-10 * BEAM.length)
    shift = turn.T @ space.contact.object_shift
    assert shift == pytest.approx(flat.contact.object_shift, abs=1e-10 * BEAM.length)
    assert space.largest_strain == pytest.approx(flat.largest_strain, rel=1e-9)
    assert space.contact.row == flat.contact.row


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.floats(0.05, 0.15), st.floats(0.05, 0.25), st.floats(-0.8, 0.8), st.floats(0.0, 1.0))
def test_the_motor_pays_for_bending_and_lifting(
    x_0: float, angle: float, nu: float, heavy: float
) -> None:
    """A rigid, frictionless edge does no work: dU / d(angle) is the moment about the motor's axis,
    here beside the clamp and not quite across the beam."""
    axis = np.array([0.0, 0.2, 1.0]) / math.hypot(0.2, 1.0)
    motor = Motor((-0.02, 0.005, 0.0), (axis[0], axis[1], axis[2]))
    weight = heavy * STEEL * np.array([0.1, -0.3, -0.9])
    rod = Rod(BEAM, weight=(weight[0], weight[1], weight[2]))
    # The edge stands where it does not touch the sagging beam from the wrong side.
    touched = obstacle(BEAM, x_0, nu=nu)
    line = rest(rod).centreline
    sag = [np.interp(x_0, line[:, 1], line[:, column]) for column in (2, 3)]
    place = touched.world_from_object.copy()
    place[1:3, 3] += sag
    touched = replace(touched, world_from_object=place)
    step = 2e-4 * angle
    low, middle, high = (
        push_one(rod, touched, x_0, angle=angle + k * step, motor=motor, intervals=1000)
        for k in (-1, 0, 1)
    )

    def stored(state: State) -> float:
        world_from_clamp = invert(motor.clamp_from_world(state.pushing_angle, (0.0, 0.0, 0.0)))
        return energy(state, weight, world_from_clamp)

    moment = middle.base_moment - np.cross(motor.point, middle.base_force)
    slope = (stored(high) - stored(low)) / (2 * step)
    assert slope == pytest.approx(-float(moment @ axis), rel=2e-6)
    turned = motor.clamp_from_world(middle.pushing_angle, (0.0, 0.0, 0.0))[:3, :3]
    assert imbalance(middle, turned @ weight) < 1e-8


def test_a_leaning_edge_leans_the_deformation_plane() -> None:
    """Frictionless, the force is across the edge: psi is the edge's, whatever the beam does."""
    for nu in (-0.9, 0.3):
        state = push_one(ROD, obstacle(BEAM, 0.12, nu=nu), 0.12, angle=1e-3)
        assert state.contact.psi == pytest.approx(nu, abs=1e-5)


def test_lengths_and_forces_scale() -> None:
    """A rig a thousand times smaller, of a thousandth of the forces."""
    small = Beam(BEAM.length / 1000, BEAM.diameter / 1000, EI * 1e-9)
    weight = (0.0, -0.3 * STEEL, -STEEL)
    compliance = 0.3 * 0.12**3 / (3 * EI)
    pushes = []
    for beam, scale in ((BEAM, 1.0), (small, 1e-3)):
        rod = Rod(beam, weight=weight, bow=(0.2 / scale, 0.1 / scale))
        touched = obstacle(beam, 0.12 * scale, nu=0.3, compliance=compliance, friction=0.2)
        steps = [Step(pushing_angle=angle) for angle in (0.1, 0.2, 0.15)]
        pushes.append(push(rod, Motor(), [touched], 0.12 * scale, steps))
    for one, other in zip(*pushes, strict=True):
        size = float(np.linalg.norm(one.contact.force))
        assert other.contact.force * 1e3 == pytest.approx(one.contact.force, abs=1e-8 * size)
        assert other.centreline * 1e3 == pytest.approx(one.centreline, abs=1e-9 * BEAM.length)


def test_a_contact_that_slips_off_the_tip_is_refused() -> None:
    with pytest.raises(EquilibriumError, match="slips off"):
        push_one(ROD, obstacle(BEAM, 0.2399), 0.2399, deflection=0.1)


def test_a_state_that_is_not_accurate_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    touched = obstacle(BEAM, 0.12)
    assert push_one(ROD, touched, 0.12, deflection=0.2).residual < 1e-10

    def sloppy(y: Floats, start: float, end: float, steps: int, *given: Floats) -> Floats:
        return np.asarray(advance(y, start, end, steps, *given) + 1e-3 / steps)

    monkeypatch.setattr(rod_contact, "advance", sloppy)
    with pytest.raises(EquilibriumError, match="residual"):
        push_one(ROD, touched, 0.12, deflection=0.2)


def test_steps_before_contact_are_at_rest() -> None:
    states = push(
        ROD,
        Motor(),
        [obstacle(BEAM, 0.12)],
        0.12,
        [Step(pushing_angle=-0.1), Step(pushing_angle=0.0), Step(pushing_angle=0.1)],
    )
    assert [len(state.contacts) for state in states] == [0, 0, 1]
    assert [state.pushing_angle for state in states] == [-0.1, 0.0, 0.1]


def test_a_step_says_one_thing() -> None:
    with pytest.raises(ValueError, match="give one"):
        Step()
    with pytest.raises(ValueError, match="allowed is 0 and more"):
        Step(deflection=-0.1)


def test_steps_interpolate_between_their_neighbours() -> None:
    before = Step(pushing_angle=0.1, drift=(1e-3, 2e-3, -3e-3))
    after = Step(pushing_angle=0.4, drift=(4e-3, -1e-3, 6e-3))
    for share in (0.0, 0.25, 1.0):
        between = after.since(before, share)
        expected = [
            (1 - share) * a + share * b for a, b in zip(before.drift, after.drift, strict=True)
        ]
        assert between.drift == pytest.approx(expected, abs=1e-15)
        assert between.size == pytest.approx((1 - share) * 0.1 + share * 0.4, rel=1e-14)
