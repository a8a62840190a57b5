import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import simpson
from scipy.optimize import brentq

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from tests.oracle import EI, oracle
from tests.simulated import BEAM
from vbaa_bench.mechanics.planar import Equilibrium, EquilibriumError, at_rest, integrate, push

THIN = Beam(0.24, 1e-12, EI)  # the oracle's world-fixed point has no radius to keep off


def test_world_fixed_contact_equals_the_oracle() -> None:
    row = oracle()["C_world_fixed_contact"][0]
    state = push(
        THIN, float(row["inputs"]["x0_m"]), pushing_angle=float(row["inputs"]["dtheta_rad"])
    )
    assert state.theta_c == pytest.approx(float(row["theta_c_rad"]), rel=1e-9)
    assert state.s_c == pytest.approx(float(row["s_c_m"]), rel=1e-9)
    assert state.force == pytest.approx(float(row["F_N"]), rel=1e-9)
    assert state.x_c == pytest.approx(float(row["x_c_m"]), rel=1e-9)
    assert state.y_c == pytest.approx(float(row["y_c_m"]), rel=1e-9)


@pytest.mark.parametrize("row", oracle()["A_frictionless_contact"], ids=lambda row: str(row["id"]))
def test_frictionless_contact_equals_the_oracle(row: dict[str, object]) -> None:
    def value(key: str) -> float:
        return float(str(row[key]))

    inputs = row["inputs"]
    assert isinstance(inputs, dict)
    s_c, length = float(inputs["s_c_m"]), 0.24
    force = value("F_N") / EI * length**2
    theta_c, bend, along, across = integrate(force, s_c / length)
    assert theta_c == pytest.approx(float(inputs["theta_c_rad"]), rel=1e-9)
    assert bend / length == pytest.approx(value("kappa_base_per_m"), rel=1e-9)
    x_c = length * (along * math.cos(theta_c) + across * math.sin(theta_c))
    assert x_c == pytest.approx(value("x_c_m"), rel=1e-9)


@pytest.mark.parametrize("row", oracle()["classical_cantilever"], ids=lambda row: str(row["alpha"]))
def test_dead_load_at_the_end_equals_the_oracle(row: dict[str, str]) -> None:
    """Bisshopp and Drucker (1945): the force keeps its direction, normal to the undeformed beam."""
    alpha = float(row["alpha"])

    def excess(slope: float) -> float:
        return float(integrate(alpha, 1.0, lean=-slope)[0] - slope)

    slope = brentq(excess, 1e-6, math.pi / 2, xtol=1e-15, rtol=1e-15)
    _, _, along, across = integrate(alpha, 1.0, lean=-slope)
    w = along * math.sin(slope) - across * math.cos(slope)
    u = 1 - (along * math.cos(slope) + across * math.sin(slope))
    assert slope == pytest.approx(float(row["theta0_rad"]), rel=1e-9)
    assert w == pytest.approx(float(row["w_over_L"]), rel=1e-9)
    assert u == pytest.approx(float(row["u_over_L"]), rel=1e-9)


def test_friction_leans_the_force_as_the_oracle_does() -> None:
    row = oracle()["B_contact_with_friction"][0]
    inputs = row["inputs"]
    s_c, length = float(inputs["s_c_m"]), 0.24
    lean = math.atan(float(inputs["mu_signed"]))
    force = float(row["F_total_N"]) / EI * length**2
    theta_c, bend, _, _ = integrate(force, s_c / length, lean=lean)
    assert theta_c == pytest.approx(float(inputs["theta_c_rad"]), rel=1e-9)
    assert bend / length == pytest.approx(float(row["kappa_base_per_m"]), rel=1e-9)


def runge_kutta(force: float, s_c: float, steps: int) -> Floats:
    """An independent road: the classical method of order 4 with fixed steps."""

    def f(state: Floats) -> Floats:
        phi, bend, _, _ = state
        return np.array([bend, force * math.cos(phi), math.cos(phi), math.sin(phi)])

    state, h = np.zeros(4), s_c / steps
    for _ in range(steps):
        a = f(state)
        b = f(state + h / 2 * a)
        c = f(state + h / 2 * b)
        d = f(state + h * c)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
    return state


def test_a_fixed_step_method_converges_to_it_with_order_four() -> None:
    force, s_c = 3.0, 0.8
    reference = integrate(force, s_c)
    errors = [np.abs(runge_kutta(force, s_c, n) - reference).max() for n in (8, 16, 32, 64)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(4.0, abs=0.2)


def test_tends_to_linear_theory_with_order_two() -> None:
    x_0, errors = 0.12, []
    for angle in (0.04, 0.02, 0.01):
        state = push(THIN, x_0, pushing_angle=angle)
        linear = 3 * EI * (x_0 * angle) / x_0**3  # (9) at the contact
        errors.append(abs(state.force / linear - 1))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.05)


@given(st.floats(0.01, 0.22), st.floats(0.01, 0.3))
def test_the_work_of_pushing_is_the_energy_of_bending(distance: float, angle: float) -> None:
    """Castigliano, as an independent road: dU / d(angle) is the clamp's moment."""
    step = 1e-4 * angle
    try:
        low, middle, high = (
            push(THIN, distance, pushing_angle=angle + k * step, intervals=2000) for k in (-1, 0, 1)
        )
    except EquilibriumError:
        assert distance > 0.15  # slips off the tip
        return

    def energy(state: Equilibrium) -> float:
        line = state.centreline[: state.contact_row + 1]
        # U = EI / 2 int kappa^2 ds, with the first integral kappa^2 = 2 F / EI sin(phi).
        phi = state.theta_c - line[:, 3]
        density = state.force * np.sin(phi)
        return float(simpson(density, x=line[:, 0]))

    slope = (energy(high) - energy(low)) / (2 * step)
    assert slope == pytest.approx(middle.moment, rel=2e-5)


@given(st.floats(0.02, 0.22), st.floats(0.01, 0.25))
def test_the_state_is_in_equilibrium_and_touches(distance: float, deflection: float) -> None:
    try:
        state = push(BEAM, distance, deflection=deflection)
    except EquilibriumError:
        assert distance > 0.2
        return
    assert state.residual < 1e-10
    assert state.tip[1] == pytest.approx(deflection * BEAM.length, rel=1e-10)
    row = state.centreline[state.contact_row]
    assert row == pytest.approx([state.s_c, state.x_c, state.y_c, state.theta_c], abs=1e-15)
    # The tip follows straight from the contact; nothing is longer than the beam.
    assert state.centreline[-1, 0] == pytest.approx(BEAM.length, rel=1e-15)
    chords = np.linalg.norm(np.diff(state.centreline[:, 1:3], axis=0), axis=1)
    assert (chords <= np.diff(state.centreline[:, 0]) * (1 + 1e-12)).all()


def test_lengths_and_forces_scale() -> None:
    small = Beam(BEAM.length / 1000, BEAM.diameter / 1000, EI * 1e-9)
    one, other = push(BEAM, 0.12, deflection=0.1), push(small, 0.12e-3, deflection=0.1)
    assert other.x_c == pytest.approx(one.x_c / 1000, rel=1e-12)
    assert other.force == pytest.approx(one.force * 1e-3, rel=1e-12)


def test_a_contact_that_slips_off_the_tip_is_refused() -> None:
    with pytest.raises(EquilibriumError, match="slips off"):
        push(BEAM, 0.2399, deflection=0.3)


def test_the_beam_at_rest_is_straight() -> None:
    line = at_rest(BEAM, 10)
    assert line.shape == (11, 4)
    assert (line[:, 2:] == 0).all()
    assert line[-1, 1] == BEAM.length
