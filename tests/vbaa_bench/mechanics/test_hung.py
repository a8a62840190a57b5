"""A weight that hangs from the beam: a dead load, whose direction is fixed in the world."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from solver.instrument.arrays import Floats
from tests.oracle import EI, oracle
from tests.vbaa_bench.mechanics.benches import BEAM, CLAMP, STEEL, imbalance, orders
from vbaa_bench.mechanics.hung import hang
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor
from vbaa_bench.mechanics.state import EquilibriumError, State

UNIT = EI / BEAM.length**2


def hung(rod: Rod, s: float, force: tuple[float, float, float], angle: float = 0.0) -> State:
    return hang(rod, CLAMP, s, np.array(force), [angle])[0]


def elastica(rod: Rod, s: float, force: Floats) -> tuple[Floats, float]:
    """Point (2,) and heading at the load, by collocation of EI theta'' = F_x sin - F_y cos."""
    rigidity, a, b = rod.beam.flexural_rigidity, force[0], force[1]
    soft, length = rod.clamp_softness, rod.beam.length

    def slope(arc: Floats, y: Floats) -> Floats:
        size = (1 + (rod.tip_ratio - 1) * arc / length) ** 4
        bend = y[3] / rigidity / size
        moment = a * np.sin(y[2]) - b * np.cos(y[2])
        return np.vstack([np.cos(y[2]), np.sin(y[2]), bend, moment])

    def ends(first: Floats, last: Floats) -> Floats:
        turned = first[2] - soft * first[3] * length / rigidity
        return np.array([first[0], first[1], turned, last[3] / rigidity])

    arc = np.linspace(0, s, 200)
    start = np.vstack([arc, 0 * arc, 0 * arc, (s - arc) * b])
    solution = solve_bvp(slope, ends, arc, start, tol=1e-10, max_nodes=100_000)
    assert solution.success
    end = solution.sol(s)
    return end[:2], float(end[2])


@pytest.mark.parametrize("s", [0.08, 0.15, 0.24])
def test_small_loads_bend_the_beam_as_in_linear_theory(s: float) -> None:
    errors = []
    for share in (0.02, 0.01, 0.005):
        load = -share * UNIT
        state = hung(Rod(BEAM), s, (0.0, load, 0.0))
        expected = load * s**2 * (3 * BEAM.length - s) / (6 * EI)
        errors.append(abs(state.tip[1] / expected - 1))
    assert errors[-1] < 1e-5
    assert orders(errors) == pytest.approx([2, 2], abs=0.05)


@pytest.mark.parametrize("row", oracle()["classical_cantilever"], ids=lambda row: str(row["alpha"]))
def test_tip_load_agrees_with_bisshopp_and_drucker(row: dict[str, str]) -> None:
    state = hung(Rod(BEAM), BEAM.length, (0.0, float(row["alpha"]) * UNIT, 0.0))
    length = BEAM.length
    assert state.tip[0] / length == pytest.approx(1 - float(row["u_over_L"]), rel=1e-9)
    assert state.tip[1] / length == pytest.approx(float(row["w_over_L"]), rel=1e-9)
    assert state.contact.theta == pytest.approx(float(row["theta0_rad"]), rel=1e-9)


@pytest.mark.parametrize(
    ("rod", "s", "heading", "size"),
    [
        (Rod(BEAM), 0.16, -1.2, 6.0),
        (Rod(BEAM, tip_ratio=0.7), 0.2, -1.9, 3.0),
        (Rod(BEAM, clamp_softness=0.08), 0.22, 1.3, 4.0),
    ],
)
def test_oblique_loads_agree_with_collocation(
    rod: Rod, s: float, heading: float, size: float
) -> None:
    force = size * UNIT * np.array([math.cos(heading), math.sin(heading), 0.0])
    contact = hung(rod, s, (force[0], force[1], 0.0)).contact
    point, theta = elastica(rod, s, force)
    assert contact.point[:2] == pytest.approx(point, abs=1e-8 * BEAM.length)
    assert math.copysign(contact.theta, theta) == pytest.approx(theta, abs=1e-7)


def test_everything_at_once_is_in_balance() -> None:
    weight = np.array([0.01, -STEEL, 0.02])
    rod = Rod(
        BEAM,
        aspect_ratio=1.5,
        section_angle=0.4,
        weight=(weight[0], weight[1], weight[2]),
        bow=(0.8, -0.5),
        clamp_softness=0.05,
    )
    force, angle = np.array([0.3, -2.0, 0.5]) * UNIT, 0.4
    state = hang(rod, CLAMP, 0.17, force, [angle])[0]
    turned = CLAMP.clamp_from_world(angle, (0.0, 0.0, 0.0))[:3, :3]
    assert state.contact.force == pytest.approx(turned @ force, rel=1e-12)
    assert imbalance(state, turned @ weight) < 1e-8


def test_a_soft_clamp_turns_in_proportion_to_its_moment() -> None:
    force = np.array([0.0, -2.0, 0.0]) * UNIT
    state = hang(Rod(BEAM, clamp_softness=0.1), CLAMP, 0.17, force, [0.0], 4000)[0]
    # The chord of the first segment is turned by half a segment's bend more.
    across, along = state.centreline[1, [2, 1]]
    moment = -state.base_moment[2] * BEAM.length / EI
    assert math.atan2(across, along) == pytest.approx(moment * (0.1 + 0.5 / 4000), rel=1e-6)


def test_the_force_keeps_its_direction_when_the_motor_turns() -> None:
    offset = Motor(point=(-0.01, 0.002, 0.0))
    force = np.array([0.0, -2.0, 0.0]) * UNIT
    angles = [-0.3, 0.0, 0.5]
    for angle, state in zip(angles, hang(Rod(BEAM), offset, 0.15, force, angles), strict=True):
        world = offset.clamp_from_world(angle, (0.0, 0.0, 0.0))[:3, :3].T @ state.contact.force
        assert world == pytest.approx(force, abs=1e-12)
        assert state.contact.normal @ state.contact.tangent == pytest.approx(0.0, abs=1e-12)


def test_rows_follow_the_number_of_segments_with_the_load_on_one() -> None:
    state = hang(Rod(BEAM), CLAMP, 0.1003, np.array([0.0, -UNIT, 0.0]), [0.0], 64)[0]
    assert len(state.centreline) == 65
    assert state.centreline[state.contact.row, 1:] == pytest.approx(state.contact.point, abs=1e-15)


@pytest.mark.parametrize("s", [0.0, 0.2401])
def test_a_load_beside_the_beam_is_refused(s: float) -> None:
    with pytest.raises(EquilibriumError, match=r"up to the tip at 0\.24 m"):
        hung(Rod(BEAM), s, (0.0, -1e-3, 0.0))
