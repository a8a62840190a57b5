"""A beam under a prescribed force: the closed form, linear theory, and the contact solver."""

import numpy as np
import pytest

from solver.beams.exact import bend_at, contact_at
from solver.instrument.beam import Beam, circular_rigidity
from vbaa_bench.mechanics import planar
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.loaded import Load, loaded
from vbaa_bench.mechanics.pushing import push
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import State
from vbaa_bench.mechanics.surfaces import upright

BEAM = Beam(0.24, 0.8e-3, circular_rigidity(200e9, 0.8e-3))


def agrees(rod: Rod, state: State, tolerance_m: float) -> None:
    """Compare a contact solver's state with the same beam under its forces alone."""
    loads = [Load.of(state, i) for i in range(len(state.contacts))]
    line = state.centreline
    beam = loaded(rod, loads, line[:, 0])
    np.testing.assert_allclose(beam.centreline, line, atol=tolerance_m)
    for i, contact in enumerate(state.contacts):
        np.testing.assert_allclose(beam.forces[i], contact.force, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(beam.points[i], contact.point, atol=tolerance_m)
    np.testing.assert_allclose(beam.base_moment, state.base_moment, rtol=1e-6, atol=1e-10)


@pytest.mark.parametrize("deflection", [0.001, 0.1, 0.4])
def test_it_agrees_with_the_planar_contact(deflection: float) -> None:
    agrees(Rod(BEAM), planar.push(BEAM, 0.14, deflection=deflection), 1e-10)


def test_it_agrees_with_the_closed_form() -> None:
    state = planar.push(BEAM, 0.14, deflection=0.2)
    load = Load.of(state)
    beam = loaded(Rod(BEAM), [load], np.array([0.0, load.s]))
    q = load.normal_force / BEAM.flexural_rigidity
    lever = float(np.linalg.norm(beam.base_moment)) / load.normal_force
    theta, x_c, y_c, s_c = (value for value, *_ in contact_at(q, lever))
    assert bend_at(lever, q)[0] > 0
    np.testing.assert_allclose(beam.points[0], [x_c, y_c, 0.0], atol=1e-11)
    np.testing.assert_allclose(beam.tangents[0, :2], [np.cos(theta), np.sin(theta)], atol=1e-10)
    assert s_c == pytest.approx(load.s, rel=1e-10)


def test_a_small_force_bends_it_as_in_linear_theory_to_second_order() -> None:
    errors = []
    for force in (0.02, 0.01, 0.005):
        line = loaded(Rod(BEAM), [Load(0.14, force)], np.array([0.0, 0.14, 0.24])).centreline
        linear = force * 0.14**2 * (3 * 0.24 - 0.14) / (6 * BEAM.flexural_rigidity)
        errors.append(abs(line[-1, 2] / linear - 1))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.02)


@pytest.mark.parametrize(
    ("rod", "normal"),
    [
        (Rod(BEAM), 0.7),
        (Rod(BEAM, tip_ratio=0.6), 0.3),
        (Rod(BEAM, bow=(0.3, 0.1)), 0.0),
    ],
    ids=["inclined", "tapered", "bowed"],
)
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_it_agrees_with_the_contact_in_space(rod: Rod, normal: float, friction: float) -> None:
    pose = np.eye(4)
    pose[:3, 1] = 0.0, np.cos(normal), np.sin(normal)
    pose[:3, 2] = 0.0, -np.sin(normal), np.cos(normal)
    # An edge below the beam at rest, to second order of its bow.
    rest = np.array([0.14, *(bow * 0.14**2 / 2 for bow in rod.bow)])
    pose[:3, 3] = rest - rod.reach(0.14, normal) * pose[:3, 1]
    edge = Obstacle(upright(), pose, spring=pose[:3, 1], friction=friction)
    (state,) = push(rod, Motor(), [edge], 0.14, [Step(deflection=0.1)])
    # Of a taper, the lever of friction neglects the surface's slope, 7e-4: 3e-6 of the deflection.
    agrees(rod, state, 1e-7 if friction and rod.tip_ratio < 1 else 1e-9)
