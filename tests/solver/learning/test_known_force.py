from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.beam import Beam
from solver.instrument.beam_shape import BeamShape
from solver.instrument.errors import InputError
from solver.learning.known_force import rig_with_force
from solver.learning.learn import learn_beam
from solver.learning.page import summary
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight
from tests.consistency import MOST_SIGMAS
from tests.hung import UNIT, hung, noisy
from tests.simulated import BEAM, rig
from tests.solver.learning.test_learn import pushes


def test_a_hung_weight_gives_ei(random: np.random.Generator) -> None:
    """By linear theory, EI is proportional to the weight that bends the beam as the image shows."""
    load = 1.2
    exact, _ = hung(0.75, load, motor_angle=0.05)
    frame = noisy(exact, random)
    wrong = replace(BEAM, flexural_rigidity=1.07 * BEAM.flexural_rigidity)
    rig = replace(frame.rig, beam=wrong, sag_in_plane=np.array([0.0, 1e-3]))
    force = load * UNIT
    known = rig_with_force(rig, frame, force, 1e-3 * force, hung_weight)
    sigma = known.tolerances.flexural_rigidity
    assert 1e-3 <= sigma / BEAM.flexural_rigidity < 5e-3
    assert abs(known.beam.flexural_rigidity - BEAM.flexural_rigidity) < MOST_SIGMAS * sigma
    assert known.sag_in_plane == pytest.approx([0.0, 1.07e-3], rel=0.02)
    # A contact's force is across the beam, and a weight's is not.
    with pytest.raises(InputError, match="exact beam with one contact"):
        rig_with_force(rig, frame, force, 1e-3 * force, exact_fit)


@pytest.mark.thorough
def test_a_force_that_contradicts_the_stated_ei_is_said() -> None:
    stated = rig(flexural_rigidity=0.01 * BEAM.flexural_rigidity)
    learned = learn_beam(pushes(0.0, BeamShape()))
    for factor, said in ((1.0, False), (1.02, False), (30.0, True)):
        ei = factor * BEAM.flexural_rigidity
        found = replace(
            stated,
            beam=Beam(BEAM.length, BEAM.diameter, ei),
            tolerances=replace(stated.tolerances, flexural_rigidity=1e-3 * ei),
        )
        text = summary(learned, found, stated)
        assert f"EI at the clamp: {ei * 1e6:.5g} +- " in text
        assert ("sigmas away: check the force" in text) is said
        assert ("as stated" in text) is (factor == 1)


def test_a_frame_without_a_force_is_refused() -> None:
    frame, _ = hung(0.75, 1.2)
    rig = replace(frame.rig, gravity=None)
    with pytest.raises(InputError, match="states no direction of gravity"):
        rig_with_force(rig, frame, UNIT, 0.0, hung_weight)
