import math
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from solver.beams import exact, linear
from solver.instrument.arrays import Floats
from tests import frictional
from tests.oracle import oracle

LEVERS, TURNS = st.floats(0.005, 0.24), st.floats(1e-4, 0.9)  # [m], q lever^2 / 2
RATIOS = st.floats(-0.8, 0.8)


def test_equals_the_oracle() -> None:
    row = oracle()["B_contact_with_friction"][0]
    inputs = {key: float(value) for key, value in row["inputs"].items()}
    rigidity = inputs["E_Pa"] * math.pi * inputs["d_m"] ** 4 / 64
    q = float(row["N_normal_N"]) / rigidity
    friction_ratio = -inputs["mu_signed"]  # there positive towards the clamp
    lever = float(row["kappa_base_per_m"]) * rigidity / float(row["F_total_N"])
    at = frictional.contact(q, lever, friction_ratio)
    assert at.load * rigidity == pytest.approx(float(row["F_total_N"]), rel=1e-14)
    assert at.theta_c == pytest.approx(inputs["theta_c_rad"], rel=1e-14)
    assert at.x_c == pytest.approx(float(row["x_c_m"]), rel=1e-14)
    assert at.y_c == pytest.approx(float(row["y_c_m"]), rel=1e-14)
    assert at.s_c == pytest.approx(inputs["s_c_m"], rel=1e-14)
    direction = at.theta_c + math.pi / 2 + at.lean
    assert direction == pytest.approx(float(row["force_angle_rad"]), rel=1e-14)
    tip_x, tip_y = (np.array([float(row[key])]) for key in ("x_tip_m", "y_tip_m"))
    misfit, _, _ = frictional.misfit(tip_x, tip_y, q, lever, friction_ratio)
    assert abs(misfit[0]) < 1e-15


@pytest.mark.parametrize("row", oracle()["A_frictionless_contact"], ids=lambda row: str(row["id"]))
def test_without_friction_it_passes_through_the_oracle(row: dict[str, object]) -> None:
    q = float(str(row["F_N"])) / float(str(row["EI_Nm2"]))
    lever = float(str(row["moment_base_Nm"])) / float(str(row["F_N"]))
    samples = row["samples_by_s"]
    assert isinstance(samples, list)
    x, y = np.array([[float(s["x_m"]), float(s["y_m"])] for s in samples]).T
    misfit, _, _ = frictional.misfit(x, y, q, lever)
    assert np.abs(misfit).max() < 1e-15  # a femtometre, on a beam of 0.24 m


@given(LEVERS, TURNS)
def test_without_friction_it_is_the_compiled_beam(lever: float, turn: float) -> None:
    q = 2 * turn / lever**2
    at = frictional.contact(q, lever)
    compiled = np.array(exact.contact_at(q, lever))
    for row, name in enumerate(("theta_c", "x_c", "y_c", "s_c")):
        assert getattr(at, name) == pytest.approx(compiled[row, 0], rel=1e-12)
        scale = np.abs(compiled[:, 1:]).max(axis=0)
        gradient = getattr(at, f"d_{name}")[:2]
        assert (gradient - compiled[row, 1:]) / scale == pytest.approx([0, 0], abs=1e-9)


@pytest.mark.parametrize(("q", "lever", "friction_ratio"), [(15.0, 0.12, 0.3), (30.0, 0.15, -0.4)])
def test_it_solves_the_equation_of_the_beam(q: float, lever: float, friction_ratio: float) -> None:
    # EI theta'' = -F sin(alpha - theta), from the clamp, alpha the force's direction.
    at = frictional.contact(q, lever, friction_ratio)
    alpha = at.theta_c + math.pi / 2 + at.lean

    def along(_s: float, state: Floats) -> list[float]:
        theta, curvature, _, _ = state
        return [curvature, -at.load * math.sin(alpha - theta), math.cos(theta), math.sin(theta)]

    beam = solve_ivp(along, (0, at.s_c), [0, at.load * lever, 0, 0], rtol=1e-12, atol=1e-14)
    theta, curvature, x, y = beam.y[:, -1]
    assert theta == pytest.approx(at.theta_c, abs=1e-11)
    assert curvature == pytest.approx(0, abs=1e-9)
    assert (x, y) == pytest.approx((at.x_c, at.y_c), abs=1e-12)
    misfit, _, _ = frictional.misfit(beam.y[2], beam.y[3], q, lever, friction_ratio)
    assert np.abs(misfit).max() < 1e-12


def test_friction_at_the_surface_moves_the_contact_towards_the_clamp() -> None:
    q, lever, friction_ratio, radius = 15.0, 0.12, 0.3, 0.4e-3
    thin, thick = (
        frictional.contact(q, lever, friction_ratio),
        frictional.contact(q, lever, friction_ratio, radius),
    )
    assert thin.s_c - thick.s_c == pytest.approx(0.12e-3, rel=1e-12)
    # About the contact's surface the force has no moment; about the clamp it has F lever.
    turned = thick.theta_c + thick.lean
    surface = (
        thick.x_c + radius * math.sin(thick.theta_c),
        thick.y_c - radius * math.cos(thick.theta_c),
    )
    arm = surface[0] * math.cos(turned) + surface[1] * math.sin(turned)
    assert arm == pytest.approx(lever, rel=1e-7)


def test_tends_to_linear_theory_with_order_two() -> None:
    x_c, x = 0.15, np.linspace(0.01, 0.24, 24)
    amplitudes = np.array([0.2, 0.1, 0.05])
    errors = []
    for q in amplitudes:
        y = q / 6 * linear.unit_deflection(x, x_c)
        misfit, _, _ = frictional.misfit(x, y, q, x_c)
        errors.append(np.abs(misfit).max() / np.abs(y).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.02)


@given(LEVERS, TURNS, RATIOS)
def test_gradients_equal_finite_differences(
    lever: float, turn: float, friction_ratio: float
) -> None:
    shape = np.array([2 * turn / lever**2, lever, friction_ratio])
    if not frictional.exists(shape[0] * 1.01, lever * 1.01, friction_ratio - 0.01):
        return
    x, y = np.linspace(0.0, 1.2 * lever, 9), np.linspace(0.0, 0.3 * lever, 9)

    def contact(p: Floats) -> frictional.Contact:
        return frictional.contact(p[0], p[1], p[2], 0.01 * lever)

    def misfit(p: Floats, dx: float = 0.0, dy: float = 0.0) -> tuple[Floats, Floats, Floats]:
        return frictional.misfit(x + dx, y + dy, p[0], p[1], p[2])

    at = contact(shape)
    _, by_point, by_shape = misfit(shape)
    for column, step in enumerate(1e-5 * np.diag([shape[0], lever, 1.0])):
        twice = 2 * step[column]
        ahead, behind = contact(shape + step), contact(shape - step)
        scale = sum(abs(getattr(at, f"d_{name}")[column]) for name in ("x_c", "y_c", "s_c"))
        for name in ("load", "theta_c", "lean", "x_c", "y_c", "s_c"):
            slope = (getattr(ahead, name) - getattr(behind, name)) / twice
            gradient = getattr(at, f"d_{name}")[column]
            # A load has no length: where it hardly changes, a difference is that of its rounding.
            rounding = 4 * np.finfo(float).eps * abs(getattr(at, name)) / twice
            least = max(1e-5 * scale, rounding)
            assert slope == pytest.approx(gradient, rel=1e-5, abs=least)
        difference = (misfit(shape + step)[0] - misfit(shape - step)[0]) / twice
        largest = np.abs(by_shape[:, column]).max()
        assert difference == pytest.approx(by_shape[:, column], abs=1e-4 * largest)
    h = 1e-6 * lever
    by_x = (misfit(shape, dx=h)[0] - misfit(shape, dx=-h)[0]) / (2 * h)
    by_y = (misfit(shape, dy=h)[0] - misfit(shape, dy=-h)[0]) / (2 * h)
    assert np.column_stack([by_x, by_y]) == pytest.approx(by_point, rel=1e-4, abs=1e-4)


@given(LEVERS, TURNS, RATIOS, st.floats(1e-3, 1e3))
def test_lengths_scale_together(
    lever: float, turn: float, friction_ratio: float, scale: float
) -> None:
    q = 2 * turn / lever**2
    if not frictional.exists(q, lever, friction_ratio):
        return
    one = frictional.contact(q, lever, friction_ratio, 1e-4)
    other = frictional.contact(q / scale**2, lever * scale, friction_ratio, 1e-4 * scale)
    assert other.theta_c == pytest.approx(one.theta_c, rel=1e-12)
    for name in ("x_c", "y_c", "s_c"):
        expected = scale * getattr(one, name)
        assert getattr(other, name) == pytest.approx(expected, abs=1e-12 * scale * lever)


def test_a_vanishing_force_is_regular() -> None:
    at = frictional.contact(0.0, 0.12)
    assert [at.theta_c, at.x_c, at.y_c] == [0.0, 0.12, 0.0]
    assert at.s_c == pytest.approx(0.12, rel=1e-15)
    misfit, _, by_shape = frictional.misfit(np.array([0.1, 0.2]), np.array([0.0, 1e-3]), 0.0, 0.12)
    assert misfit == pytest.approx([0.0, 1e-3])
    assert np.isfinite(by_shape).all()
    for friction_ratio in (0.3, -0.3):
        straight = frictional.contact(0.0, 0.12, friction_ratio)
        assert all(np.isfinite(value).all() for value in astuple(straight))


@pytest.mark.parametrize("friction_ratio", [0.0, 0.3, -0.3])
def test_gradients_by_the_force_are_continuous_where_their_series_begins(
    friction_ratio: float,
) -> None:
    lever, about = 0.12, 2e-5 / 0.12**2  # q lever^2 / 2 = 1e-5
    below, above = (
        frictional.contact(about * (1 + by), lever, friction_ratio) for by in (-1e-6, 1e-6)
    )
    for name in ("d_x_c", "d_y_c", "d_s_c"):
        one, other = getattr(below, name)[0], getattr(above, name)[0]
        assert one == pytest.approx(other, abs=1e-9 * abs(below.d_y_c[0]))
