"""Refusals carry the name of what the image contradicts."""

import numpy as np
import pytest

from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.instrument.beam_shape import UNIFORM, BeamShape, stated_shape
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.lab.table import row
from solver.methods.exact_fit import exact_fit
from solver.tracker import run_method
from tests.tapered import bent, measured

WIRE = stated_shape(taper=0.02, softness=0.002, section=0.02, friction=0.2)
POLISHED = stated_shape(taper=0.0, softness=0.0, section=0.0, friction=0.02)
NAMES = {
    "taper": {Assumption.TAPER, Assumption.TAPER_OR_FRICTION},
    "friction": {Assumption.FRICTION, Assumption.TAPER_OR_FRICTION},
}


@pytest.mark.parametrize(
    ("broken", "taper", "friction", "load", "shape"),
    [
        ("taper", -0.4, 0.0, 1.2, WIRE),
        ("taper", -0.04, 0.0, 1.0, UNIFORM),
        ("friction", 0.0, 0.5, 1.2, POLISHED),
    ],
)
def test_what_breaks_a_statement_is_named(
    broken: str,
    taper: float,
    friction: float,
    load: float,
    shape: BeamShape,
    random: np.random.Generator,
) -> None:
    beam = bent(taper, 0.6, load, friction)
    estimates = [exact_fit(measured(beam, shape, random)) for _ in range(3)]
    named = {one.assumption for one in estimates if "rig.json" in one.message}
    assert named
    assert named <= NAMES[broken]


def test_a_beam_bent_to_the_other_side_contradicts_the_side(random: np.random.Generator) -> None:
    taken = measured(bent(0.0, 0.6, -1.0), UNIFORM, random)
    refusal = no_contact(nearest_linear_bend(taken))
    assert refusal is not None
    assert refusal.assumption is Assumption.SIDE


def test_a_misfit_in_other_light_contradicts_the_light(random: np.random.Generator) -> None:
    taken = measured(bent(0.0, 0.6, 1.0), UNIFORM, random)
    misfit = Estimate(Outcome.INVALID, "no fit")
    assert run_method(lambda _: misfit, taken).assumption is None
    assert run_method(lambda _: misfit, taken, "darker").assumption is Assumption.LIGHT
    found = run_method(lambda _: Estimate(Outcome.NO_CONTACT), taken, "darker")
    assert found.assumption is None


def test_the_name_is_a_column() -> None:
    refused = Estimate(Outcome.INVALID, "why", assumption=Assumption.TAPER_OR_FRICTION)
    assert row("a", refused, None)["assumption"] == "taper or friction"
    assert row("a", Estimate(Outcome.NO_CONTACT), None)["assumption"] is None
    with pytest.raises(ValueError, match="contradicts the taper"):
        Estimate(Outcome.CONTACT, values={"x_c_m": 0.1}, assumption=Assumption.TAPER)
