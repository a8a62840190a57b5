"""Two contacts by two roads: the world's rod between two pegs, and the antenna's beam."""

import math

import numpy as np
import pytest

from solver.beams.beam import S_C, Q
from solver.beams.stretch import WIDTHS
from solver.beams.two_contacts import (
    INNER_PARAMETERS,
    Q_INNER,
    S_INNER,
    STEPS,
    contacts_of,
    two_contacts_of,
)
from tests.simulated import BEAM
from tests.vbaa_bench.mechanics.benches import obstacle
from vbaa_bench.mechanics.loaded import Load, loaded
from vbaa_bench.mechanics.pushing import push
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step


@pytest.mark.thorough
@pytest.mark.parametrize(("second", "gap", "angle"), [(0.16, 1e-3, 0.1), (0.19, 3e-3, 0.4)])
def test_the_rod_between_two_pegs_has_the_same_contacts(
    second: float, gap: float, angle: float
) -> None:
    above = obstacle(BEAM, second, nu=math.pi, clearance=gap)
    pegs = [obstacle(BEAM, 0.08), above]
    state = push(Rod(BEAM), Motor(), pegs, 0.08, [Step(pushing_angle=angle)])[0]
    inner, outer = state.contacts
    unit = BEAM.length**2 / BEAM.flexural_rigidity
    p = np.zeros(WIDTHS + INNER_PARAMETERS)
    p[Q] = math.copysign(np.linalg.norm(outer.force), outer.force[1]) * unit
    p[Q_INNER] = np.linalg.norm(inner.force) * unit
    p[S_C], p[S_INNER] = outer.s / BEAM.length, inner.s / BEAM.length
    both = two_contacts_of(p, 0, BEAM.radius / BEAM.length, 64)
    contacts, _ = contacts_of(both, p)
    for row, contact in enumerate((inner, outer)):
        assert contacts[row, 1] == pytest.approx(contact.theta, abs=1e-7)
        assert contacts[row, 2:4] * BEAM.length == pytest.approx(contact.point[:2], abs=1e-8)
    # The clamp carries both forces.
    angles = contacts[:, 1]
    force = contacts[:, 0] @ np.column_stack([-np.sin(angles), np.cos(angles)]) / unit
    assert force == pytest.approx(-state.base_force[:2], rel=1e-7)


@pytest.mark.thorough
@pytest.mark.parametrize("frictions", [(0.0, 0.0), (0.3, -0.2)])
def test_a_bowed_cone_under_two_loads_has_the_same_contacts(
    frictions: tuple[float, float],
) -> None:
    length, taper, bow = BEAM.length, -0.3, 0.4
    unit = BEAM.flexural_rigidity / length**2
    (q_inner, s_inner), (q_outer, s_outer) = (4.0, 0.4), (-1.5, 0.8)
    loads = [
        # A force to the other side comes from there, and acts on that side of the surface.
        Load(
            s * length,
            abs(q) * unit,
            0.0 if q > 0 else math.pi,
            (math.copysign(friction, q * friction), 0.0),
        )
        for q, s, friction in zip((q_inner, q_outer), (s_inner, s_outer), frictions, strict=True)
    ]
    rod = Rod(BEAM, tip_ratio=1 + taper, bow=(bow, 0.0))
    world = loaded(rod, loads, np.linspace(0.0, length, 11))
    # A circular arc at rest: its line, to the order of the world's small curvature.
    bowed = [taper, bow * length / 2, 0.0, 0.0]
    p = np.array([q_outer, s_outer, frictions[1], *bowed, q_inner, s_inner, frictions[0]])
    contacts, _ = contacts_of(two_contacts_of(p, 1, BEAM.radius / length, STEPS), p)
    assert contacts[:, 2:4] * length == pytest.approx(world.points[:, :2], abs=1e-6 * length)
