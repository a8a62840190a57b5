import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.instrument.beam import Beam
from solver.instrument.transforms import invert
from tests.oracle import EI
from tests.vbaa_bench.mechanics.benches import BEAM, CLAMP, energy, imbalance
from vbaa_bench.mechanics import planar
from vbaa_bench.mechanics.planar import push
from vbaa_bench.mechanics.state import EquilibriumError, State


def test_walk_converges_with_the_order_of_its_series() -> None:
    tau = 1.6
    reference = np.array(planar.walk(tau, 0.05))
    steps = np.arange(2, 7)  # one leaves the circle of convergence, more reach rounding
    errors = [np.abs(np.array(planar.walk(tau, tau / n)) - reference).max() for n in steps]
    slope, _ = np.polyfit(np.log(steps), np.log(errors), 1)
    assert slope == pytest.approx(-planar.ORDER, abs=1.5)


def test_walk_keeps_its_first_integral() -> None:
    """phi'' = cos(phi) gives phi'^2 = 2 sin(phi)."""
    for tau in np.linspace(0.01, 1.8, 20):
        phi, bend, along, _ = planar.walk(float(tau))
        assert bend**2 == pytest.approx(2 * math.sin(phi), rel=1e-13)
        assert bend == pytest.approx(along, rel=1e-13)  # the base moment is force times lever


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.floats(0.01, 0.22), st.floats(0.01, 0.3))
def test_the_work_of_pushing_is_the_energy_of_bending(distance: float, angle: float) -> None:
    """Castigliano, as an independent road: dU / d(angle) is the clamp's moment."""
    step = 1e-4 * angle
    try:
        low, middle, high = (
            push(BEAM, distance, pushing_angle=angle + k * step, intervals=2000) for k in (-1, 0, 1)
        )
    except EquilibriumError:
        assert distance > 0.15  # slips off the tip
        return

    def stored(state: State) -> float:
        world_from_clamp = invert(CLAMP.clamp_from_world(state.pushing_angle, (0.0, 0.0, 0.0)))
        return energy(state, np.zeros(3), world_from_clamp)

    slope = (stored(high) - stored(low)) / (2 * step)
    assert slope == pytest.approx(-middle.base_moment[2], rel=1e-6)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.floats(0.02, 0.22),
    st.floats(0.01, 0.25),
    st.floats(0.0, 0.02),
    st.floats(0.0, 2.0),
    st.floats(0.6, 2.5),
)
def test_the_state_balances_and_touches(
    distance: float, deflection: float, radius: float, softness: float, heading: float
) -> None:
    compliance = softness * distance**3 / (3 * EI)
    try:
        state = push(
            BEAM,
            distance,
            deflection=deflection,
            object_radius=radius,
            compliance=compliance,
            spring_heading=heading,
        )
    except EquilibriumError:
        assert distance > 0.1  # it slips off, or the soft object is carried along
        return
    assert state.residual < 1e-9
    assert imbalance(state, np.zeros(3)) < 1e-9
    assert state.tip[1] == pytest.approx(deflection * BEAM.length, rel=1e-9)
    contact = state.contact
    row = state.centreline[contact.row]
    assert row == pytest.approx([contact.s, *contact.point], abs=1e-15)
    # In the world, the object has given way by what its spring says, and is touched.
    clamp_from_world = CLAMP.clamp_from_world(state.pushing_angle, (0.0, 0.0, 0.0))
    turn = clamp_from_world[:3, :3]
    shift = turn.T @ contact.object_shift
    direction = np.array([math.cos(heading), math.sin(heading), 0.0])
    give = -compliance * ((turn.T @ contact.force) @ direction) * direction
    assert shift == pytest.approx(give, abs=1e-12)
    centre = np.array([distance, -BEAM.radius - radius, 0.0]) + shift
    reach = np.linalg.norm(turn.T @ contact.point - centre)
    assert reach == pytest.approx(BEAM.radius + radius, abs=1e-9 * BEAM.length)
    # The tip follows straight from the contact; nothing is longer than the beam.
    assert state.centreline[-1, 0] == pytest.approx(BEAM.length, rel=1e-15)
    chords = np.linalg.norm(np.diff(state.centreline[:, 1:], axis=0), axis=1)
    assert (chords <= np.diff(state.centreline[:, 0]) * (1 + 1e-12)).all()


def test_lengths_and_forces_scale() -> None:
    small = Beam(BEAM.length / 1000, BEAM.diameter / 1000, EI * 1e-9)
    one, other = push(BEAM, 0.12, deflection=0.1), push(small, 0.12e-3, deflection=0.1)
    assert other.contact.s == pytest.approx(one.contact.s / 1000, rel=1e-12)
    assert other.contact.force == pytest.approx(one.contact.force * 1e-3, rel=1e-12)
    assert other.largest_strain == pytest.approx(one.largest_strain, rel=1e-12)


def test_a_contact_that_slips_off_the_tip_is_refused() -> None:
    with pytest.raises(EquilibriumError, match="slips off"):
        push(BEAM, 0.2399, deflection=0.3)


def test_a_state_that_is_not_accurate_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = planar._solve

    def sloppy(*given: float) -> tuple[float, float, float, float]:
        tau, scale, angle, _ = exact(*given)
        return tau, scale, angle, 2e-8

    monkeypatch.setattr(planar, "_solve", sloppy)
    with pytest.raises(EquilibriumError, match=r"residual 2\.0e-08"):
        push(BEAM, 0.12, deflection=0.1)


def test_an_impossible_push_is_refused() -> None:
    with pytest.raises(EquilibriumError, match="no equilibrium"):
        push(BEAM, 0.12, pushing_angle=1.5)


@pytest.mark.parametrize("given", [{}, {"deflection": 0.1, "pushing_angle": 0.1}])
def test_one_of_angle_and_deflection_is_given(given: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="give one"):
        push(BEAM, 0.12, **given)  # type: ignore[arg-type]


@pytest.mark.parametrize("deflection", [0.0, -0.1])
def test_a_push_goes_forward(deflection: float) -> None:
    with pytest.raises(ValueError, match="not positive"):
        push(BEAM, 0.12, deflection=deflection)


def test_a_push_so_small_that_numbers_underflow_has_no_equilibrium() -> None:
    with pytest.raises(EquilibriumError, match="singular"):
        push(BEAM, 0.1, deflection=1e-302)
    with pytest.raises(EquilibriumError, match="singular"):
        push(BEAM, 0.1, pushing_angle=1e-302)
