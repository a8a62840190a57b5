"""Contacts of a beam whose bow is as large as its deflection."""

import numpy as np
import pytest

from solver.instrument.beam_shape import stated_shape
from solver.methods.exact_fit import exact_fit
from tests.consistency import MOST_SIGMAS
from tests.simulated import BEAM, columns
from tests.tapered import SIGMA, bowed
from vbaa_bench.mechanics.loaded import Load, loaded
from vbaa_bench.mechanics.rod import Rod

SHAPE = stated_shape(taper=0.03, softness=0.0, section=0.02, friction=0.15)
LENGTH = BEAM.length
# Of the tip [m]: 3 % of the length, which is that of a wire from a coil.
BOW = 0.03 * LENGTH


@pytest.mark.parametrize("place", [0.25, 0.5, 0.85])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_bow_is_no_contact(side: int, place: float, random: np.random.Generator) -> None:
    """The bow at rest is known; a start that takes it for a bend ends at the clamp, or nowhere."""
    curvature = side * 2 * BOW / LENGTH**2
    deflection = 0.015 * LENGTH
    force = 3 * deflection / (place * LENGTH) ** 3 * BEAM.flexural_rigidity
    beam = loaded(
        Rod(BEAM, bow=(curvature, 0.0)),
        [Load(place * LENGTH, force, friction=(0.0, 0.0))],
        np.linspace(0.0, LENGTH, 2001),
    )
    points = columns(beam.centreline)
    points[:, 1] += SIGMA * random.standard_normal(len(points))
    removed = np.column_stack([np.zeros(len(points)), curvature / 2 * points[:, 0] ** 2])
    bow = np.array([side * BOW, 0.0, 0.0])
    answer = exact_fit(bowed(points, removed, bow, np.zeros(3), SHAPE))
    assert "x_c_m" in answer.values, answer
    assert answer.sigma("x_c_m") < 0.02 * LENGTH
    assert abs(answer.values["x_c_m"] - beam.points[0, 0]) < MOST_SIGMAS * answer.sigma("x_c_m")
