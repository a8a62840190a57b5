"""Two contacts by two roads: the world's rod between two pegs, and the antenna's beam."""

import math

import numpy as np
import pytest

from solver.beam_models.two_contacts import contacts_of, two_contacts_of
from tests.simulated import BEAM
from tests.vbaa_bench.mechanics.benches import obstacle
from vbaa_bench.mechanics.pushing import Motor, Step, push
from vbaa_bench.mechanics.rod import Rod


@pytest.mark.parametrize(("second", "gap", "angle"), [(0.16, 1e-3, 0.1), (0.19, 3e-3, 0.4)])
def test_the_rod_between_two_pegs_has_the_same_contacts(
    second: float, gap: float, angle: float
) -> None:
    above = obstacle(BEAM, second, nu=math.pi, clearance=gap)
    pegs = [obstacle(BEAM, 0.08), above]
    state = push(Rod(BEAM), Motor(), pegs, 0.08, [Step(pushing_angle=angle)])[0]
    inner, outer = state.contacts
    unit = BEAM.length**2 / BEAM.flexural_rigidity
    p = np.array(
        [
            math.copysign(np.linalg.norm(outer.force), outer.force[1]) * unit,
            outer.s / BEAM.length,
            np.linalg.norm(inner.force) * unit,
            inner.s / BEAM.length,
        ]
    )
    both = two_contacts_of(p, 64)
    contacts, _ = contacts_of(both, p)
    for row, contact in enumerate((inner, outer)):
        assert contacts[row, 1] == pytest.approx(contact.theta, abs=1e-7)
        assert contacts[row, 2:4] * BEAM.length == pytest.approx(contact.point[:2], abs=1e-8)
    # The clamp carries both forces.
    angles = contacts[:, 1]
    force = contacts[:, 0] @ np.column_stack([-np.sin(angles), np.cos(angles)]) / unit
    assert force == pytest.approx(-state.base_force[:2], rel=1e-7)
