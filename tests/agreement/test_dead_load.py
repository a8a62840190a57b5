"""The world's rod under a force of fixed direction, and the antenna's dead load."""

import math

import numpy as np
import pytest

from solver.beams.beam import FRICTION_RATIO, POSE, S_C, Q
from solver.beams.dead_load import friction_ratio_of
from solver.beams.integrated import IntegratedBeam
from solver.photographs.bent_beam import places_on
from tests.simulated import BEAM
from vbaa_bench.mechanics.loaded import Load, loaded
from vbaa_bench.mechanics.rod import Rod


@pytest.mark.parametrize("lean_deg", [-15.0, 0.0, 20.0])
@pytest.mark.parametrize("q", [0.3, 1.6])
@pytest.mark.parametrize("taper", [-0.2, 0.0])
def test_a_dead_load_bends_the_world_s_rod_as_the_antenna_s(
    lean_deg: float, q: float, taper: float
) -> None:
    length, bow, place = BEAM.length, 0.3, 0.7
    direction = math.pi / 2 + math.radians(lean_deg)
    beam = IntegratedBeam(1, 3, 0.0)
    p = np.zeros(7 + POSE)
    p[[Q, S_C]], p[3], p[4] = (q, place), taper, bow * length / 2
    friction_ratio = friction_ratio_of(beam, p, direction)
    assert friction_ratio is not None
    p[FRICTION_RATIO] = friction_ratio.value
    shape = beam.bent(p[:-POSE])
    assert shape is not None
    # A beam so thin that a force on its surface acts at its axis.
    thin = type(BEAM)(length, 1e-6 * BEAM.diameter, BEAM.flexural_rigidity)
    world = loaded(
        Rod(thin, tip_ratio=1 + taper, bow=(bow, 0.0)),
        [
            Load(
                place * length,
                q * BEAM.flexural_rigidity / length**2,
                friction=(friction_ratio.value, 0.0),
            )
        ],
        np.linspace(0.0, length, 201),
    )
    x, y, _ = world.forces[0]
    # The integrators differ by a millionth of the length.
    assert math.atan2(y, x) == pytest.approx(direction, abs=3e-6)
    contact, tip = places_on(shape, p, np.array([place, 1.0]))
    assert contact * length == pytest.approx(world.points[0, :2], abs=2e-6 * length)
    assert tip * length == pytest.approx(world.centreline[-1, 1:3], abs=4e-6 * length)
