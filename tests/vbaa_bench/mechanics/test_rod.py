"""What the beam does by itself, and how it bends where its section is not round and even."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, simpson
from scipy.interpolate import CubicSpline

from solver.instrument.transforms import rigid
from tests.oracle import EI
from tests.vbaa_bench.mechanics.benches import (
    BEAM,
    STEEL,
    THIN,
    imbalance,
    leaning,
    obstacle,
    orders,
    push_one,
)
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.pushing import rest
from vbaa_bench.mechanics.rod import ORDER, POISSON, Rod, advance, trace
from vbaa_bench.mechanics.state import State
from vbaa_bench.mechanics.surfaces import upright

EVERYTHING = Rod(
    BEAM,
    aspect_ratio=1.5,
    section_angle=0.4,
    tip_ratio=0.6,
    weight=(0.01, -0.02, -STEEL),
    bow=(0.8, -0.5),
    extensible=True,
)


def test_integration_converges_with_order_eight() -> None:
    properties, force = EVERYTHING.properties(np.eye(3)), np.array([-0.5, 2.0, 0.3])
    clamp = EVERYTHING.clamp(np.array([0.05, -0.25, 0.9]))
    reference = advance(clamp, 0.0, 1.0, 1000, force, properties)
    errors = [
        float(np.abs(advance(clamp, 0.0, 1.0, n, force, properties) - reference).max())
        for n in (8, 16, 32, 64)
    ]
    assert orders(errors) == pytest.approx([ORDER] * 3, abs=0.7)


def test_directors_stay_a_right_angled_frame() -> None:
    clamp = EVERYTHING.clamp(np.array([0.05, -0.25, 0.9]))
    force = np.array([-0.5, 2.0, 0.3])
    end = advance(clamp, 0.0, 1.0, 64, force, EVERYTHING.properties(np.eye(3)))
    first, tangent = end[3:6], end[6:9]
    assert [first @ first, tangent @ tangent] == pytest.approx([1, 1], abs=1e-12)
    assert first @ tangent == pytest.approx(0.0, abs=1e-12)


def test_nothing_asked_for_is_a_straight_beam() -> None:
    state = rest(Rod(BEAM), 10)
    assert state.centreline.shape == (11, 4)
    assert (state.centreline[:, 2:] == 0).all()
    assert state.tip[0] == pytest.approx(BEAM.length, rel=1e-15)
    assert state.contacts == ()
    with pytest.raises(ValueError, match="touches nothing"):
        _ = state.contact


def test_gravity_sags_the_reference_beam_by_four_millimetres() -> None:
    state = rest(Rod(BEAM, weight=(0.0, 0.0, -STEEL)))
    assert state.tip[2] == pytest.approx(-4.0e-3, abs=0.05e-3)
    assert imbalance(state, np.array([0.0, 0.0, -STEEL])) < 1e-9
    errors = []
    for share in (1.0, 0.5, 0.25):
        sag = -rest(Rod(BEAM, weight=(0.0, 0.0, -share * STEEL))).tip[2]
        errors.append(abs(sag / (share * STEEL * BEAM.length**4 / (8 * EI)) - 1))
    assert orders(errors) == pytest.approx([2.0, 2.0], abs=0.05)


@pytest.mark.parametrize("towards", [0.0, 0.7, 2.0])
def test_bow_is_a_circular_arc(towards: float) -> None:
    curvature = 0.9
    bow = (curvature * math.cos(towards), curvature * math.sin(towards))
    state = rest(Rod(BEAM, bow=bow, section_angle=0.3))
    turned = curvature * state.centreline[:, 0]
    across = np.outer((1 - np.cos(turned)) / curvature, leaning(towards)[1:])
    assert state.centreline[:, 1] == pytest.approx(np.sin(turned) / curvature, abs=1e-14)
    assert state.centreline[:, 2:] == pytest.approx(across, abs=1e-14)
    assert state.largest_strain == pytest.approx(0.0, abs=1e-12)  # unloaded, however bent


def test_a_hanging_beam_grows_longer_by_its_weight() -> None:
    """w L^2 / 2 EA; here of a beam as soft as rubber, and 4 % of its length."""
    weight = 0.08 * 4 * EI / BEAM.radius**2 / BEAM.length
    state = rest(Rod(BEAM, weight=(weight, 0.0, 0.0), extensible=True))
    area_modulus = 4 * EI / BEAM.radius**2
    grown = weight * BEAM.length**2 / (2 * area_modulus)
    assert state.tip[0] - BEAM.length == pytest.approx(grown, rel=1e-9)
    stiff = rest(Rod(BEAM, weight=(weight, 0.0, 0.0)))
    assert stiff.tip[0] == pytest.approx(BEAM.length, rel=1e-14)


def test_a_tapered_beam_grows_longer_where_it_is_thin() -> None:
    area_modulus, pull = 4 * EI / BEAM.radius**2, 0.02 * 4 * EI / BEAM.radius**2 / BEAM.length
    state = rest(Rod(BEAM, tip_ratio=0.5, weight=(pull, 0.0, 0.0), extensible=True))

    def strain(x: float) -> float:
        size = 1 - 0.5 * x / BEAM.length
        hanging = 2 / 3 * BEAM.length * (size**3 - 0.5**3)  # the integral of size^2 from x on
        return pull * hanging / (area_modulus * size**2)

    grown, _ = quad(strain, 0.0, BEAM.length)
    assert state.tip[0] - BEAM.length == pytest.approx(grown, rel=1e-9)


@pytest.mark.parametrize(
    ("shape", "aspect_ratio", "stiffness"),
    [
        # G J over E I of bending along the first axis; J: Timoshenko and Goodier (1970).
        ("ellipse", 1.0, 2.0),  # J = pi r^4 / 2
        ("ellipse", 3.0, 4 * 9 / (1 + 9)),  # J = pi a^3 b^3 / (a^2 + b^2)
        ("rectangle", 1.0, 0.1406 * 12),  # J = 0.1406 (2a)^4
        ("rectangle", 10.0, 0.312 * 12),  # J = 0.312 (2a)^3 2b
    ],
)
def test_a_couple_twists_the_beam(shape: Any, aspect_ratio: float, stiffness: float) -> None:
    rod, couple = Rod(BEAM, shape=shape, aspect_ratio=aspect_ratio), 0.3
    clamp = rod.clamp(np.array([couple, 0.0, 0.0]))
    end = advance(clamp, 0.0, 1.0, 32, np.zeros(3), rod.properties(np.eye(3)))
    twist = math.atan2(end[5], end[4])
    assert twist == pytest.approx(couple * 2 * (1 + POISSON) / stiffness, rel=6e-3)
    assert end[:3] == pytest.approx([1.0, 0.0, 0.0], abs=1e-14)


@pytest.mark.parametrize("tip_ratio", [0.02, 0.1, 0.3, 0.7, 1.4])
def test_a_tapered_beam_yields_by_the_integral_of_its_flexibility(tip_ratio: float) -> None:
    x_0, angle = 0.15, 1e-3
    rod = Rod(THIN, tip_ratio=tip_ratio)
    state = push_one(rod, obstacle(rod, x_0), x_0, angle=angle)

    def flexibility(x: float) -> float:
        return (x_0 - x) ** 2 / (EI * (1 + (tip_ratio - 1) * x / THIN.length) ** 4)

    softness, _ = quad(flexibility, 0.0, x_0)
    assert state.contact.force[1] == pytest.approx(x_0 * angle / softness, rel=5e-6)


def test_weight_of_a_tapered_beam_is_that_of_its_sections() -> None:
    weight = (0.0, 0.0, -0.01 * STEEL)
    rod = Rod(BEAM, tip_ratio=0.5, weight=weight)

    def size(x: float) -> float:
        return 1 - 0.5 * x / BEAM.length

    total, _ = quad(lambda x: size(x) ** 2, 0.0, BEAM.length)
    moment, _ = quad(lambda x: x * size(x) ** 2, 0.0, BEAM.length)
    state = rest(rod)
    assert state.base_force[2] == pytest.approx(-weight[2] * total, rel=1e-12)
    assert state.base_moment[1] == pytest.approx(weight[2] * moment, rel=1e-6)


@pytest.mark.parametrize(("aspect_ratio", "section_angle"), [(1.5, 0.5), (3.0, -0.4), (0.5, 1.2)])
def test_an_elliptic_section_bends_aside(aspect_ratio: float, section_angle: float) -> None:
    """Small deflection: the displacement is the 2 x 2 flexibility matrix times the force."""
    x_0, angle, nu = 0.12, 1e-3, 0.2
    rod = Rod(THIN, aspect_ratio=aspect_ratio, section_angle=section_angle)
    state = push_one(rod, obstacle(rod, x_0, nu=nu), x_0, angle=angle)
    first, second = leaning(section_angle)[1:], leaning(section_angle + math.pi / 2)[1:]
    stiffness = np.outer(first, first) + aspect_ratio**2 * np.outer(second, second)
    flexibility = x_0**3 / (3 * EI) * np.linalg.inv(stiffness)
    normal = leaning(nu)[1:]
    moved = flexibility @ normal
    force = x_0 * angle * math.cos(nu) / float(normal @ moved)
    assert state.contact.force[1:] == pytest.approx(force * normal, rel=1e-4)
    moved = moved * force
    size = float(np.linalg.norm(moved))
    assert state.contact.point[1:] == pytest.approx(moved, abs=1e-3 * size)
    # It does turn out of the force's direction.
    assert abs(np.cross([*moved, 0], [*normal, 0])[2]) > 0.1 * size


@pytest.mark.parametrize("section_angle", [0.0, 0.4])
def test_a_strip_bends_about_its_weak_axis(section_angle: float) -> None:
    strip = Rod(BEAM, shape="rectangle", aspect_ratio=8.0, section_angle=section_angle)
    aligned = obstacle(strip, 0.12, nu=section_angle)
    state = push_one(strip, aligned, 0.12, deflection=0.1)
    assert state.contact.psi == pytest.approx(section_angle, abs=1e-3)
    askew = obstacle(strip, 0.12, nu=section_angle + math.radians(10))
    state = push_one(strip, askew, 0.12, deflection=0.1)
    assert state.contact.psi == pytest.approx(section_angle, abs=math.radians(5))
    assert imbalance(state, np.zeros(3)) < 1e-8


def test_strain_of_a_round_beam_is_curvature_times_radius() -> None:
    state = push_one(Rod(BEAM), obstacle(BEAM, 0.12), 0.12, deflection=0.1)
    expected = float(np.linalg.norm(state.base_moment)) / EI * BEAM.radius
    assert state.largest_strain == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(
    ("shape", "aspect_ratio"),
    [("ellipse", 1.0), ("ellipse", 2.5), ("rectangle", 2.5), ("rectangle", 0.4)],
)
def test_strain_is_that_of_the_farthest_fibre(shape: Any, aspect_ratio: float) -> None:
    """Differentiate the tangent of a tapered beam, and multiply by the distance of each fibre."""
    rod = Rod(BEAM, shape=shape, aspect_ratio=aspect_ratio, section_angle=0.4, tip_ratio=0.6)
    rows, forces = np.linspace(0.0, 1.0, 481), np.array([[-0.5, 2.0, 3.0]])
    clamp = rod.clamp(np.array([0.05, -3.0, 2.5]))
    properties = rod.properties(np.eye(3))
    states = trace(clamp, np.array([1.0]), forces, np.zeros((1, 3)), rows, properties, 1)
    curvatures = CubicSpline(rows, states[:, 6:9])(rows, 1) / BEAM.length
    around = np.linspace(0.0, math.tau, 2000)
    circle = np.column_stack([np.cos(around), np.sin(around)])
    outline = circle if shape == "ellipse" else np.array([[1.0, 1.0], [1.0, -1.0]])
    for i in (48, 240, 384):
        first, tangent = states[i, 3:6], states[i, 6:9]
        bend = curvatures[i] @ np.column_stack([first, np.cross(tangent, first)])
        fibres = rod.half_height(rows[i] * BEAM.length) * outline * [1.0, aspect_ratio]
        strain = rod.largest_strain(rows[i : i + 1], states[i : i + 1])
        assert strain == pytest.approx(np.abs(fibres @ bend).max(), rel=2e-5)


@pytest.mark.parametrize("tip_ratio", [0.3, 1.4])
def test_a_frictionless_force_is_perpendicular_to_the_surface_of_a_tapered_beam(
    tip_ratio: float,
) -> None:
    """The surface is inclined to the centreline by the change of the radius per arc length."""
    rod = Rod(BEAM, tip_ratio=tip_ratio)
    contact = push_one(rod, obstacle(rod, 0.15), 0.15, angle=0.2).contact
    inclination = (rod.half_height(BEAM.length) - rod.half_height(0.0)) / BEAM.length
    size = float(np.linalg.norm(contact.force))
    assert contact.force @ contact.tangent == pytest.approx(inclination * size, abs=1e-9 * size)
    assert contact.force == pytest.approx(size * contact.normal, abs=1e-9 * size)


def test_a_tapered_beam_is_followed_to_a_large_angle() -> None:
    """The contact moves outwards steadily, and forces and moments balance."""
    rod, distances = Rod(BEAM, tip_ratio=0.6), []
    for angle in (0.3, 0.4, 0.5):
        state = push_one(rod, obstacle(rod, 0.16), 0.16, angle=angle)
        assert imbalance(state, np.zeros(3)) < 1e-8
        distances.append(state.contact.s)
    assert 0.16 < distances[0] < distances[1] < distances[2] < 0.17


def whisker(tip_ratio: float, bow: float, x_0: float) -> tuple[Rod, Obstacle]:
    """A beam with a bow [L], and an edge that touches it at rest at `x_0` [L]."""
    length = BEAM.length
    rod = Rod(BEAM, tip_ratio=tip_ratio, bow=(8 * bow / length, 0.0))
    curvature, turned = rod.bow[0], rod.bow[0] * x_0 * length
    point = np.array([x_0 * length, 0.0, 0.0])
    if bow:
        point = np.array([math.sin(turned), 1 - math.cos(turned), 0.0]) / curvature
    across = np.array([-math.sin(turned), math.cos(turned), 0.0])
    pose = rigid([0.0, 0.0, turned], point - rod.reach(x_0 * length, 0.0) * across)
    return rod, Obstacle(upright(), pose)


WHISKERS = [(0.3, 0.1), (0.1, -0.1), (0.05, 0.1), (0.02, 0.0), (0.02, -0.1)]


@pytest.mark.thorough
@pytest.mark.parametrize(("tip_ratio", "bow"), WHISKERS)
def test_the_motor_does_the_work_of_bending_a_whisker(tip_ratio: float, bow: float) -> None:
    """The energy is from the curvature of the centreline alone, the work from the clamp's moment.

    The object is rigid and frictionless: the derivative of the energy by the angle is the moment.
    """
    rod, edge = whisker(tip_ratio, bow, 0.7)

    def bending_energy(state: State) -> float:
        s, line = state.centreline[:, 0], state.centreline[:, 1:]
        row, total = state.contact.row, 0.0
        for part in (slice(0, row + 1), slice(row, None)):
            curve = CubicSpline(s[part], line[part])
            first, second = curve(s[part], 1), curve(s[part], 2)
            curvature = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
            rigidity = EI * (1 + (tip_ratio - 1) * s[part] / BEAM.length) ** 4
            total += simpson(rigidity * (curvature - rod.bow[0]) ** 2 / 2, x=s[part])
        return total

    angle, change = 0.1, 1e-3
    low, middle, high = (
        push_one(rod, edge, 0.7 * BEAM.length, angle=a, intervals=2000)
        for a in (angle - change, angle, angle + change)
    )
    rate = (bending_energy(high) - bending_energy(low)) / (2 * change)
    assert rate == pytest.approx(-middle.base_moment[2], rel=1e-4)
    assert imbalance(middle, np.zeros(3)) < 1e-8


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("tip_ratio", "bow", "x_0", "deflection"),
    [
        # Without a check of the force, Newton's method leaves for an S or a coil in each of them.
        (0.05, 0.1, 0.8294, 0.09),
        (0.02, -0.1, 0.9, 0.02),
        (0.02, -0.1, 0.9, 0.15),
        (0.05, 0.0, 0.87, 0.14),
    ],
)
def test_a_whisker_is_bent_to_one_side(
    tip_ratio: float, bow: float, x_0: float, deflection: float
) -> None:
    """One frictionless contact bends the beam in one direction, from the clamp to the contact."""
    rod, edge = whisker(tip_ratio, bow, x_0)
    state = push_one(rod, edge, x_0 * BEAM.length, deflection=deflection)
    lever = state.contact.point - state.centreline[: state.contact.row, 1:]
    assert (np.cross(lever, state.contact.force)[:, 2] > 0).all()
    assert np.linalg.norm((state.tip - rest(rod).tip)[1:]) == pytest.approx(
        deflection * BEAM.length, rel=1e-8
    )


@pytest.mark.parametrize("tip_ratio", [0.02, 0.1])
def test_few_segments_do_not_coarsen_a_thin_tip(tip_ratio: float) -> None:
    rod, edge = whisker(tip_ratio, 0.05, 0.8)
    few, many = (
        push_one(rod, edge, 0.8 * BEAM.length, deflection=0.1, intervals=n) for n in (16, 960)
    )
    assert few.tip == pytest.approx(many.tip, abs=1e-8 * BEAM.length)
