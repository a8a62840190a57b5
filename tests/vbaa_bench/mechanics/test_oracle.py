"""The world's beam against 25-digit values that were computed elsewhere."""

import math
from typing import Any

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from tests.oracle import EI, oracle
from vbaa_bench.mechanics import planar
from vbaa_bench.mechanics.rod import Rod, advance

LENGTH = 0.24
THIN = Beam(LENGTH, 2e-12, EI)  # the oracle's point in the world has no radius to keep off
ROD = Rod(THIN)


def value(row: dict[str, Any], key: str) -> float:
    return float(row[key])


def carried(force: Floats, base_moment: float, s: float) -> Floats:
    """The rod's state (12,) at `s`, under the oracle's force and base moment; all in its units."""
    clamp = ROD.clamp(np.array([0.0, 0.0, base_moment]))
    return np.asarray(advance(clamp, 0.0, s, 64, force, ROD.properties(np.eye(3))))


def heading(state: Floats) -> float:
    return math.atan2(state[7], state[6])


@pytest.mark.parametrize("row", oracle()["A_frictionless_contact"], ids=lambda row: str(row["id"]))
def test_walk_reaches_the_frictionless_contact(row: dict[str, Any]) -> None:
    scale = math.sqrt(EI / value(row, "F_N"))
    theta_c, bend, along, across = planar.walk(value(row["inputs"], "s_c_m") / scale)
    assert theta_c == pytest.approx(value(row["inputs"], "theta_c_rad"), rel=1e-9)
    assert bend / scale == pytest.approx(value(row, "kappa_base_per_m"), rel=1e-9)
    sine, cosine = math.sin(theta_c), math.cos(theta_c)
    assert scale * (along * cosine + across * sine) == pytest.approx(value(row, "x_c_m"), rel=1e-9)
    assert scale * (along * sine - across * cosine) == pytest.approx(value(row, "y_c_m"), rel=1e-9)


@pytest.mark.parametrize("row", oracle()["A_frictionless_contact"], ids=lambda row: str(row["id"]))
def test_push_finds_the_frictionless_contact(row: dict[str, Any]) -> None:
    distance = math.hypot(value(row, "x_c_m"), value(row, "y_c_m"))
    state = planar.push(THIN, distance, deflection=value(row, "y_tip_m") / LENGTH)
    assert state.contact.s == pytest.approx(value(row["inputs"], "s_c_m"), rel=1e-9)
    assert state.contact.theta == pytest.approx(value(row["inputs"], "theta_c_rad"), rel=1e-9)
    assert state.contact.force[0] == pytest.approx(value(row, "Fx_N"), rel=1e-9)
    assert state.contact.force[1] == pytest.approx(value(row, "Fy_N"), rel=1e-9)
    assert state.base_moment[2] == pytest.approx(-value(row, "moment_base_Nm"), rel=1e-9)
    assert state.tip[0] == pytest.approx(value(row, "x_tip_m"), rel=1e-9)


@pytest.mark.parametrize("row", oracle()["A_frictionless_contact"], ids=lambda row: str(row["id"]))
def test_rod_passes_through_the_samples(row: dict[str, Any]) -> None:
    unit = ROD.force_unit
    force = np.array([value(row, "Fx_N"), value(row, "Fy_N"), 0.0]) / unit
    moment = value(row, "kappa_base_per_m") * LENGTH
    s_c = value(row["inputs"], "s_c_m")
    for sample in row["samples_by_s"]:
        if value(sample, "s_m") <= s_c:
            state = carried(force, moment, value(sample, "s_m") / LENGTH)
            assert state[0] * LENGTH == pytest.approx(value(sample, "x_m"), abs=1e-10 * LENGTH)
            assert state[1] * LENGTH == pytest.approx(value(sample, "y_m"), abs=1e-10 * LENGTH)
            assert heading(state) == pytest.approx(value(sample, "theta_rad"), abs=1e-9)


def test_rod_carries_a_contact_with_friction() -> None:
    row = oracle()["B_contact_with_friction"][0]
    angle = value(row, "force_angle_rad")
    size = value(row, "F_total_N") / ROD.force_unit
    force = size * np.array([math.cos(angle), math.sin(angle), 0.0])
    base_moment = value(row, "kappa_base_per_m") * LENGTH
    state = carried(force, base_moment, value(row["inputs"], "s_c_m") / LENGTH)
    assert state[0] * LENGTH == pytest.approx(value(row, "x_c_m"), rel=1e-9)
    assert state[1] * LENGTH == pytest.approx(value(row, "y_c_m"), rel=1e-9)
    assert heading(state) == pytest.approx(value(row["inputs"], "theta_c_rad"), rel=1e-9)
    assert state[11] == pytest.approx(0.0, abs=1e-9 * base_moment)


@pytest.mark.parametrize("row", oracle()["classical_cantilever"], ids=lambda row: str(row["alpha"]))
def test_rod_carries_a_dead_load_at_its_end(row: dict[str, Any]) -> None:
    """Bisshopp and Drucker (1945): the force keeps its direction, normal to the undeformed beam."""
    alpha, shortening = value(row, "alpha"), value(row, "u_over_L")
    state = carried(np.array([0.0, alpha, 0.0]), alpha * (1 - shortening), 1.0)
    assert state[0] == pytest.approx(1 - shortening, rel=1e-9)
    assert state[1] == pytest.approx(value(row, "w_over_L"), rel=1e-9)
    assert heading(state) == pytest.approx(value(row, "theta0_rad"), rel=1e-9)
    assert state[11] == pytest.approx(0.0, abs=1e-9 * alpha)


def test_push_finds_a_contact_fixed_in_the_world() -> None:
    row = oracle()["C_world_fixed_contact"][0]
    inputs = row["inputs"]
    state = planar.push(THIN, value(inputs, "x0_m"), pushing_angle=value(inputs, "dtheta_rad"))
    contact = state.contact
    assert contact.theta == pytest.approx(value(row, "theta_c_rad"), rel=1e-9)
    assert contact.s == pytest.approx(value(row, "s_c_m"), rel=1e-9)
    assert np.linalg.norm(contact.force) == pytest.approx(value(row, "F_N"), rel=1e-9)
    assert contact.point[0] == pytest.approx(value(row, "x_c_m"), rel=1e-9)
    assert contact.point[1] == pytest.approx(value(row, "y_c_m"), rel=1e-9)
