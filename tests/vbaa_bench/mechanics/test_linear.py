import math

import numpy as np
import pytest

from solver.instrument.beam import Beam
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
from vbaa_bench.mechanics import linear, planar
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.state import EquilibriumError


def test_it_solves_the_beam_equation() -> None:
    """EI y'''' = 0 on both sides of the contact: a cubic, then a line; y, y', y'' run on."""
    state = linear.push(BEAM, 0.15, deflection=0.1)
    row = state.contact.row
    x, y = state.centreline[:, 1], state.centreline[:, 2]
    cubic = np.polynomial.Polynomial.fit(x[: row + 1], y[: row + 1], 3)
    line = np.polynomial.Polynomial.fit(x[row:], y[row:], 1)
    assert np.abs(cubic(x[: row + 1]) - y[: row + 1]).max() < 1e-15
    assert np.abs(line(x[row:]) - y[row:]).max() < 1e-15
    assert cubic(0.0) == pytest.approx(0.0, abs=1e-15)
    assert cubic.deriv()(0.0) == pytest.approx(0.0, abs=1e-13)
    assert cubic.deriv()(0.15) == pytest.approx(line.deriv()(0.15), rel=1e-10)
    assert cubic.deriv(2)(0.15) == pytest.approx(0.0, abs=1e-9)
    assert EI * cubic.deriv(3)(0.1) == pytest.approx(-state.contact.force[1], rel=1e-9)
    assert EI * cubic.deriv(2)(0.0) == pytest.approx(-state.base_moment[2], rel=1e-9)
    assert x[row] == 0.15
    assert y[-1] == pytest.approx(0.1 * BEAM.length, rel=1e-15)


@pytest.mark.parametrize("x_0", [0.06, 0.12, 0.2])
@pytest.mark.parametrize("softness", [0.0, 1.0])
def test_the_exact_beam_tends_to_it_with_order_two(x_0: float, softness: float) -> None:
    compliance = softness * x_0**3 / (3 * EI)
    errors: dict[str, list[float]] = {"force": [], "angle": [], "tip": []}
    for deflection in (0.04, 0.02, 0.01):
        exact = planar.push(THIN, x_0, deflection=deflection, compliance=compliance)
        paper = linear.push(THIN, x_0, deflection=deflection, compliance=compliance)
        errors["force"].append(abs(exact.contact.force[1] / paper.contact.force[1] - 1))
        errors["angle"].append(abs(exact.pushing_angle / paper.pushing_angle - 1))
        errors["tip"].append(abs(exact.tip[0] / paper.tip[0] - 1))
    for name, found in errors.items():
        assert orders(found) == pytest.approx([2.0, 2.0], abs=0.1), name


def test_a_leaning_edge_tends_to_it_with_order_two() -> None:
    nu, x_0, errors = 0.5, 0.12, []
    for angle in (0.04, 0.02, 0.01):
        exact = push_one(Rod(THIN), obstacle(THIN, x_0, nu=nu), x_0, angle=angle)
        paper = linear.push(THIN, x_0, pushing_angle=angle, normal_angle=nu)
        gap = exact.contact.force - paper.contact.force
        errors.append(float(np.linalg.norm(gap[1:]) / np.linalg.norm(paper.contact.force)))
    assert (orders(errors) > 1.8).all()


def test_angle_and_deflection_ask_for_the_same_state() -> None:
    one = linear.push(BEAM, 0.1, deflection=0.12, normal_angle=0.4, compliance=0.3)
    other = linear.push(
        BEAM, 0.1, pushing_angle=one.pushing_angle, normal_angle=0.4, compliance=0.3
    )
    assert other.contact.force == pytest.approx(one.contact.force, rel=1e-12)
    assert other.centreline == pytest.approx(one.centreline, abs=1e-15)


def test_object_and_beam_share_the_way() -> None:
    x_c, nu, compliance = 0.1, 0.4, 0.05
    state = linear.push(BEAM, x_c, pushing_angle=0.1, normal_angle=nu, compliance=compliance)
    contact = state.contact
    normal = leaning(nu)
    way = x_c * math.tan(0.1) * math.cos(nu)
    assert contact.point @ normal - contact.object_shift @ normal == pytest.approx(way, rel=1e-12)
    assert contact.object_shift @ normal == pytest.approx(
        -compliance * float(contact.force @ normal), rel=1e-12
    )
    assert contact.psi == pytest.approx(nu, rel=1e-12)
    assert state.largest_strain == pytest.approx(
        float(np.linalg.norm(state.base_moment)) / EI * BEAM.radius, rel=1e-12
    )


def test_it_balances_on_the_undeformed_beam() -> None:
    state = linear.push(BEAM, 0.1, deflection=0.1, normal_angle=-0.3)
    assert state.base_force == pytest.approx(-state.contact.force)
    lever = np.array([0.1, 0.0, 0.0])
    assert state.base_moment == pytest.approx(-np.cross(lever, state.contact.force))


def test_lengths_and_forces_scale() -> None:
    small = Beam(BEAM.length / 1000, BEAM.diameter / 1000, EI * 1e-9)
    one, other = linear.push(BEAM, 0.12, deflection=0.1), linear.push(small, 1.2e-4, deflection=0.1)
    assert other.contact.force == pytest.approx(one.contact.force * 1e-3, rel=1e-12)


@pytest.mark.parametrize("distance", [0.0, 0.24, 0.3])
def test_the_contact_is_on_the_beam(distance: float) -> None:
    with pytest.raises(EquilibriumError, match="not on the beam"):
        linear.push(BEAM, distance, deflection=0.1)


def test_one_of_angle_and_deflection_is_given() -> None:
    with pytest.raises(ValueError, match="give one"):
        linear.push(BEAM, 0.1)


def test_the_judge_of_balance_can_fail() -> None:
    """`imbalance` sees a weight that is not there."""
    state = planar.push(BEAM, 0.12, deflection=0.1)
    assert imbalance(state, np.zeros(3)) < 1e-9 < imbalance(state, np.array([0.0, 0.0, -STEEL]))


def test_its_contact_is_that_of_the_exact_beam_at_small_deflection() -> None:
    paper = linear.push(BEAM, 0.12, deflection=1e-4).contact
    exact = planar.push(BEAM, 0.12, deflection=1e-4).contact
    assert paper.lever == pytest.approx(exact.lever, abs=1e-3 * BEAM.radius)
    assert paper.normal == pytest.approx(exact.normal, abs=1e-3)
    assert paper.tangent == pytest.approx(exact.tangent, abs=1e-6)


def test_the_object_is_on_the_side_from_which_it_pushes() -> None:
    contact = linear.push(BEAM, 0.12, deflection=0.1, normal_angle=0.4).contact
    size = float(np.linalg.norm(contact.force))
    assert contact.lever @ contact.force == pytest.approx(-BEAM.radius * size, rel=1e-12)


def test_the_only_object_is_the_first_obstacle() -> None:
    for state in (
        linear.push(BEAM, 0.12, deflection=0.1),
        planar.push(BEAM, 0.12, deflection=0.1),
    ):
        assert [contact.obstacle for contact in state.contacts] == [0]
