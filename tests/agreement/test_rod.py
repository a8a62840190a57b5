"""The world's rod under prescribed loads, and the antenna's rod: two integrators, one beam."""

import numpy as np
import pytest

from solver.beams.beam import S_C
from solver.beams.curve import Curve, P, U
from solver.beams.integrated import STEPS, contact_of, curve_of
from solver.instrument.arrays import Floats
from tests.simulated import BEAM
from vbaa_bench.mechanics.loaded import Load, loaded
from vbaa_bench.mechanics.rod import Rod


def _in_clamp_frame(curve: Curve) -> Floats:
    """Nodes (m, 2) of a curve in the clamp's frame."""
    lever, height, angle = curve.base
    along, across = lever - curve.nodes[U], curve.nodes[P] - height
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(np.column_stack([along, across]) @ rotation.T)


@pytest.mark.parametrize("taper", [-0.4, -0.03, 0.2])
@pytest.mark.parametrize("friction", [-0.3, 0.0, 0.4])
@pytest.mark.parametrize("bow", [0.0, 0.4])
def test_the_rods_agree(taper: float, friction: float, bow: float) -> None:
    length, place, q = BEAM.length, 0.62, 1.1
    rod = Rod(BEAM, tip_ratio=1 + taper, bow=(bow, 0.0))
    unit = BEAM.flexural_rigidity / length**2
    world = loaded(
        rod,
        [Load(place * length, q * unit, friction=(friction, 0.0))],
        np.linspace(0.0, length, 1001),
    )
    # A circular arc at rest: its line, to the order of the world's small curvature.
    p = np.array([q, place, friction, taper, bow * length / 2, 0.0, 0.0])
    radius = BEAM.radius / length
    curve = curve_of(p, 1, radius, STEPS)
    values, _ = contact_of(curve, p)
    # The world's contact is on the axis too. A millionth of the length is 1/2000 px.
    assert values[2:4] * length == pytest.approx(world.points[0, :2], abs=1e-6 * length)
    line = _in_clamp_frame(curve) * length
    beam = world.centreline
    for x, y in line[curve.contact : -1]:
        nearest = np.interp(x, beam[:, 1], beam[:, 2])
        assert y == pytest.approx(nearest, abs=2e-6 * length)
    assert values[4] == p[S_C]
