"""What is pushed: walls, springs, adaptors, drifting things, pairs, balls and meshes."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from solver.instrument.arrays import Floats
from solver.instrument.transforms import rigid
from tests.draws import generator
from tests.oracle import EI
from tests.vbaa_bench.mechanics.benches import (
    BEAM,
    CLAMP,
    THIN,
    imbalance,
    obstacle,
    orders,
    push_one,
)
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.pushing import push
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.mechanics.surfaces import Flat, Solid, ball, upright

ROD, WIRE = Rod(BEAM), Rod(THIN)


def same(one: State, other: State, within: float) -> None:
    size = float(np.linalg.norm(one.contact.force))
    assert other.contact.s == pytest.approx(one.contact.s, rel=within)
    assert other.contact.force == pytest.approx(one.contact.force, abs=within * size)
    assert other.centreline == pytest.approx(one.centreline, abs=within * BEAM.length)


def test_a_beam_lifts_off_a_wall() -> None:
    """At x = 3 gap / dtheta, in the limit of small angles."""
    reached, errors = 0.12, []
    for angle in (0.08, 0.04, 0.02):
        gap = reached * angle / 3
        wall = obstacle(THIN, 0.0, Flat(), clearance=gap)
        state = push_one(WIRE, wall, 0.0, angle=angle)
        errors.append(abs(state.contact.s / reached - 1))
        # Beyond the contact it lies on the wall: in the world, straight and across y.
        assert state.contact.theta == pytest.approx(angle, abs=1e-9)
    assert orders(errors) == pytest.approx([2.0, 2.0], abs=0.1)


def test_a_wall_is_touched_up_to_the_tip() -> None:
    """The contact x = 3 gap / dtheta is within the beam from the angle 3 gap / L on."""
    angle = 0.02
    wall = obstacle(THIN, 0.0, Flat(), clearance=0.95 * THIN.length * angle / 3)
    state = push_one(WIRE, wall, 0.0, angle=angle)
    assert state.contact.s == pytest.approx(0.95 * THIN.length, rel=1e-3)
    with pytest.raises(EquilibriumError, match="lies along the wall"):
        push_one(WIRE, wall, 0.0, angle=0.9 * angle)


def test_a_soft_object_gives_way_like_its_spring() -> None:
    x_0, compliance, angle = 0.12, 0.1, 0.15
    spring = np.array([math.cos(1.2), math.sin(1.2), 0.0])
    touched = replace(obstacle(BEAM, x_0, compliance=compliance), spring=spring)
    state = push_one(ROD, touched, x_0, angle=angle)
    turn = CLAMP.clamp_from_world(angle, (0.0, 0.0, 0.0))[:3, :3]
    force, shift = turn.T @ state.contact.force, turn.T @ state.contact.object_shift
    assert force @ spring == pytest.approx(-float(shift @ spring) / compliance, rel=1e-10)
    assert np.cross(shift, spring) == pytest.approx(np.zeros(3), abs=1e-15)
    # And the surface's touched point is where the edge has gone, in x and y of the world.
    touching = turn.T @ (state.contact.point + state.contact.lever)
    edge = np.array([x_0, -BEAM.radius, 0.0]) + shift
    assert touching[:2] == pytest.approx(edge[:2], abs=1e-12)


def test_a_stiff_object_tends_to_a_rigid_one() -> None:
    x_0 = 0.12
    rigid_one = push_one(ROD, obstacle(BEAM, x_0), x_0, angle=0.15).contact.force[1]
    errors = []
    for compliance in (4e-4, 2e-4, 1e-4):
        soft = push_one(ROD, obstacle(BEAM, x_0, compliance=compliance), x_0, angle=0.15)
        errors.append(abs(soft.contact.force[1] / rigid_one - 1))
    assert orders(errors) == pytest.approx([1.0, 1.0], abs=0.01)


@pytest.mark.parametrize("offset", [0.01, 0.05])
def test_an_adaptor_carries_the_clamp_round(offset: float) -> None:
    x_0, errors = 0.12, []
    motor = Motor(point=(-offset, 0.0, 0.0))
    for angle in (0.04, 0.02, 0.01):
        state = push_one(WIRE, obstacle(THIN, x_0), x_0, angle=angle, motor=motor)
        linear = 3 * EI * (x_0 + offset) * angle / x_0**3
        errors.append(abs(state.contact.force[1] / linear - 1))
    assert errors[-1] < 1e-3
    assert orders(errors) == pytest.approx([2.0, 2.0], abs=0.1)


def over(x: float, clearance: float) -> Obstacle:
    """An edge above the beam, looking down."""
    return obstacle(THIN, x, nu=math.pi, clearance=clearance)


def test_the_second_peg_holds_the_beam_down() -> None:
    """Superposition: where both pegs stand, the deflection is the sum of both forces'."""
    first, second, errors = 0.08, 0.16, []

    def yields(x: float, at: float) -> float:  # deflection at x per force at `at`, eqs. (9), (10)
        x, at = (x, at) if x <= at else (at, x)
        return x**2 * (3 * at - x) / (6 * EI)

    for angle in (0.04, 0.02, 0.01):
        clearance = 0.01 * angle
        pegs = [obstacle(THIN, first), over(second, clearance)]
        state = push(WIRE, Motor(), pegs, first, [Step(pushing_angle=angle)])[0]
        matrix = [[yields(x, at) for at in (first, second)] for x in (first, second)]
        wanted = [first * angle, second * angle + clearance]
        one, other = np.linalg.solve(matrix, wanted)
        assert one > 0 > other
        found = np.array([contact.force[1] for contact in state.contacts])
        errors.append(float(np.abs(found / [one, other] - 1).max()))
        assert imbalance(state, np.zeros(3)) < 1e-8
    assert errors[-1] < 2e-3
    assert orders(errors) == pytest.approx([2.0, 2.0], abs=0.2)


def test_a_peg_before_the_first_is_met_as_well() -> None:
    """The order in which pegs are met is not that in which they stand along the beam."""
    pegs = [obstacle(BEAM, 0.16), obstacle(BEAM, 0.08, clearance=2.5e-3)]
    steps = [Step(pushing_angle=angle) for angle in (0.05, 0.1, 0.12)]
    states = push(ROD, Motor(), pegs, 0.16, steps)
    assert [len(state.contacts) for state in states] == [1, 2, 2]
    for state in states[1:]:
        assert [contact.obstacle for contact in state.contacts] == [0, 1]
        assert state.contacts[0].s > state.contacts[1].s
        assert imbalance(state, np.zeros(3)) < 1e-8


def test_a_peg_out_of_reach_is_not_touched() -> None:
    pegs = [obstacle(THIN, 0.08), over(0.16, 0.1)]
    state = push(WIRE, Motor(), pegs, 0.08, [Step(pushing_angle=0.1)])[0]
    alone = push_one(WIRE, pegs[0], 0.08, angle=0.1)
    assert len(state.contacts) == 1
    same(alone, state, 1e-9)


def test_a_drifting_object_is_a_new_one_where_it_went() -> None:
    drift = (0.004, -0.001, 0.0)
    moved = push(
        ROD, Motor(), [obstacle(BEAM, 0.12)], 0.12, [Step(pushing_angle=0.15, drift=drift)]
    )[0]
    place = obstacle(BEAM, 0.12 + drift[0], clearance=-drift[1])
    same(push_one(ROD, place, 0.12 + drift[0], angle=0.15), moved, 1e-10)


def test_a_ball_is_touched_like_a_cylinder_in_the_plane() -> None:
    flat = push_one(ROD, obstacle(BEAM, 0.12, upright(0.02)), 0.12, deflection=0.05)
    same(flat, push_one(ROD, obstacle(BEAM, 0.12, ball(0.02)), 0.12, deflection=0.05), 1e-9)


def test_a_beam_slips_off_a_ball_it_bends_too_far_on() -> None:
    radius, x_0 = 0.01, 0.12
    bent = (radius + BEAM.radius) / x_0  # the angle at which the deflection is the radii's sum
    push_one(ROD, obstacle(BEAM, x_0, ball(radius)), x_0, angle=0.97 * bent)
    with pytest.raises(EquilibriumError, match="slip off the sphere sideways"):
        push_one(ROD, obstacle(BEAM, x_0, ball(radius)), x_0, angle=1.03 * bent)


def test_a_ball_aside_drives_the_beam_off_the_faster_the_nearer_the_limit() -> None:
    """The beam at z, the ball at e: F (z - e) / (R + r) = k z. Of q = F / (R + r) k, z is
    -e q / (1 - q), which runs away at q = 1; this is the limit that `check` enforces."""
    radius, x_0, aside = 0.02, 0.12, 1e-6
    for share in (0.2, 0.5, 0.8):
        angle = share * (radius + BEAM.radius) / x_0
        touched = obstacle(BEAM, x_0, ball(radius))
        place = touched.world_from_object.copy()
        place[2, 3] = aside
        state = push_one(ROD, replace(touched, world_from_object=place), x_0, angle=angle)
        expected = -share / (1 - share)
        assert state.contact.point[2] / aside == pytest.approx(expected, rel=0.05)


def box(turn: float = 0.0) -> trimesh.Trimesh:
    mesh: trimesh.Trimesh = trimesh.creation.box((0.02, 0.02, 0.1))
    mesh.apply_translation([0.01, -0.01, 0.0])
    mesh.apply_transform(rigid([0.0, 0.0, turn], np.zeros(3)))
    return mesh


@pytest.mark.parametrize("turn", [0.0, -0.2, -0.5])
def test_a_box_is_its_edge(turn: float) -> None:
    for deflection in (0.02, 0.1, 0.2):
        edge = push_one(ROD, obstacle(BEAM, 0.12), 0.12, deflection=deflection)
        solid = push_one(ROD, obstacle(BEAM, 0.12, Solid(box(turn))), 0.12, deflection=deflection)
        same(edge, solid, 1e-10)


@pytest.mark.parametrize("surface", [None, Solid(box(-0.2))], ids=["edge", "mesh"])
def test_a_solution_beyond_the_tip_is_not_taken_for_a_slip(surface: Solid | None) -> None:
    """Strides of the usual length lead to another branch here; finer ones stay on the beam."""
    rod = Rod(BEAM, aspect_ratio=1.5, section_angle=0.4, tip_ratio=0.6)
    state = push_one(rod, obstacle(rod, 0.22, surface), 0.22, angle=0.3)
    assert state.contact.s == pytest.approx(0.22387, abs=1e-5)


def many_sided(sides: int, radius: float) -> trimesh.Trimesh:
    """A prism about a cylinder's axis, one of its edges on the origin."""
    mesh: trimesh.Trimesh = trimesh.creation.cylinder(radius, 0.1, sections=sides)
    mesh.apply_transform(rigid([0.0, 0.0, math.pi / 2], [0.0, -radius, 0.0]))
    return mesh


def test_a_prism_of_many_sides_tends_to_the_cylinder() -> None:
    radius = 0.01
    round_one = push_one(ROD, obstacle(BEAM, 0.12, upright(radius)), 0.12, deflection=0.1)
    errors = []
    for sides in (64, 256):
        prism = Solid(many_sided(sides, radius))
        state = push_one(ROD, obstacle(BEAM, 0.12, prism), 0.12, deflection=0.1)
        errors.append(abs(state.contact.s - round_one.contact.s))
    assert errors[0] < math.tau / 64 * radius  # the width of a side
    assert errors[1] < math.tau / 256 * radius


def test_the_beam_rolls_over_the_edges_of_a_prism() -> None:
    def edge(state: State) -> Floats:
        turn = CLAMP.clamp_from_world(state.pushing_angle, (0.0, 0.0, 0.0))[:3, :3]
        return turn.T @ (state.contact.point + state.contact.lever)

    touched = obstacle(BEAM, 0.12, Solid(many_sided(64, 0.01)))
    early, late = (push_one(ROD, touched, 0.12, angle=angle) for angle in (0.01, 0.25))
    assert np.linalg.norm(edge(early)[:2] - edge(late)[:2]) > 0.5e-3


def two_ridges(lower: float) -> Solid:
    """One on the origin, and one nearer to the clamp and lower [m]."""
    far, near = box(-0.5), box(-0.5)
    near.apply_translation([-0.06, -lower, 0.0])
    both: Any = trimesh.util.concatenate([far, near])
    return Solid(both)


@pytest.mark.parametrize("lower", [0.0015, 0.002, 0.0023])
def test_a_beam_on_two_ridges_at_once_is_refused(lower: float) -> None:
    """Linear theory: it rests on both where the lower one is 1.41 to 2.45 mm lower."""
    mesh = two_ridges(lower)
    with pytest.raises(EquilibriumError, match="two edges or corners of the mesh at once"):
        push_one(ROD, obstacle(BEAM, 0.14, mesh), 0.14, angle=0.1)


def test_a_beam_on_the_upper_ridge_alone_is_found() -> None:
    mesh = two_ridges(0.003)
    state = push_one(ROD, obstacle(BEAM, 0.14, mesh), 0.14, angle=0.1)
    same(push_one(ROD, obstacle(BEAM, 0.14), 0.14, angle=0.1), state, 1e-10)


@pytest.mark.thorough
@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.sampled_from(["ball", "box", "prism"]), st.integers(0, 1000))
def test_a_beam_never_passes_through_a_mesh(kind: str, seed: int) -> None:
    mesh = {
        "ball": trimesh.creation.icosphere(2, 0.01),
        "box": trimesh.creation.box((0.02, 0.02, 0.02)),
        "prism": trimesh.creation.cylinder(0.01, 0.06, sections=24),
    }[kind]
    turn = Rotation.random(rng=generator(__name__, seed)).as_rotvec()
    mesh.apply_transform(rigid(turn, np.zeros(3)))
    mesh.apply_translation(-mesh.vertices[mesh.vertices[:, 1].argmax()])  # its top is touched
    touched = obstacle(BEAM, 0.12, Solid(mesh))
    try:
        state = push_one(ROD, touched, 0.12, angle=0.1, intervals=240)
    except EquilibriumError as error:
        assert "two edges or corners" in str(error)  # noqa: PT017 - a right refusal will do
        return
    turned = CLAMP.clamp_from_world(0.1, (0.0, 0.0, 0.0))[:3, :3]
    line = state.centreline[:, 1:] @ turned - touched.world_from_object[:3, 3]
    closest: Any = trimesh.proximity.closest_point_naive
    _, distance, _ = closest(mesh, line)
    assert distance.min() > BEAM.radius * (1 - 1e-6)
    # These are convex: outside is above the plane of some face.
    above = np.einsum("pfi,fi->pf", line[:, None] - mesh.triangles_center, mesh.face_normals)
    assert (above.max(axis=1) > 0).all()


def test_a_point_inside_a_mesh_is_found_inside() -> None:
    solid = Solid(trimesh.creation.icosphere(2, 0.01))
    assert solid.holds(np.array([[0.02, 0.0, 0.0], [0.009, 0.0, 0.0]]))
    assert not solid.holds(np.array([[0.02, 0.0, 0.0], [0.0099, 0.0099, 0.0]]))


def test_a_strip_is_pushed_by_an_edge_alone() -> None:
    strip = Rod(BEAM, shape="rectangle", aspect_ratio=8.0)
    with pytest.raises(ValueError, match="one edge alone"):
        push_one(strip, obstacle(strip, 0.12, upright(0.01)), 0.12, angle=0.1)
