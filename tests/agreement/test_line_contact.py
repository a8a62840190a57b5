"""A beam that lies on a flat wall: the whole force is that at the place where it lifts off."""

import numpy as np
import pytest

from solver.methods.exact_fit import exact_fit
from tests.simulated import BEAM, columns, measurement
from tests.vbaa_bench.mechanics.benches import obstacle, push_one
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.surfaces import Flat


def test_the_estimated_force_is_all_that_the_wall_exerts() -> None:
    # Beyond the place the beam is straight, without moment, and so without load (fig. 5).
    angle, gap = 0.2, 8e-3
    wall = obstacle(BEAM, 0.0, Flat(), clearance=gap)
    state = push_one(Rod(BEAM), wall, 0.0, angle=angle, intervals=8000)
    estimate = exact_fit(measurement(columns(state.centreline), 1e-7))
    assert estimate.s_c_m == pytest.approx(state.contact.s, rel=1e-4)
    assert estimate.force_n == pytest.approx(np.linalg.norm(state.base_force), rel=1e-4)
    assert estimate.s_c_m == pytest.approx(3 * gap / angle, rel=0.02)
