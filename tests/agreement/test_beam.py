"""World and antenna compute the beam by different roads; here they meet."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import frictional
from tests.simulated import BEAM
from vbaa_bench.mechanics.planar import push
from vbaa_bench.mechanics.state import EquilibriumError


@settings(max_examples=25, deadline=None)
@given(st.floats(0.01, 0.235), st.floats(0.005, 0.45))
def test_integrated_beam_lies_on_the_closed_form(distance: float, deflection: float) -> None:
    try:
        state = push(BEAM, distance, deflection=deflection)
    except EquilibriumError:
        assert distance > 0.2  # near the tip a large deflection slips off
        return
    contact = state.contact
    force, moment = np.linalg.norm(contact.force), -state.base_moment[2]
    q, lever = float(force) / BEAM.flexural_rigidity, float(moment / force)
    at = frictional.contact(q, lever)
    assert at.x_c == pytest.approx(contact.point[0], rel=1e-9)
    assert at.y_c == pytest.approx(contact.point[1], rel=1e-9)
    assert at.s_c == pytest.approx(contact.s, rel=1e-9)
    assert at.theta_c == pytest.approx(contact.theta, rel=1e-9)
    x, y = state.centreline[:, 1], state.centreline[:, 2]
    misfit, _, _ = frictional.misfit(x, y, q, lever)
    assert np.abs(misfit).max() < 1e-10 * BEAM.length
