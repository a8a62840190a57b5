"""Images of a beam that is not the one of its rig are refused, and no others."""

from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.beam_shape import UNIFORM, stated_shape
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement, Tip
from solver.methods.exact_fit import exact_fit
from solver.methods.exact_fit_3d import exact_fit_3d
from tests.draws import generator
from tests.solver.fitting.test_neighbours import disturbed
from tests.tapered import SIGMA, bent, measured

WIRE = stated_shape(taper=0.02, softness=0.002, section=0.02, friction=0.2)
ANY_TAPER = stated_shape(taper=0.4, softness=0.002, section=0.02, friction=0.2)


@pytest.mark.parametrize(("place", "load"), [(0.4, 0.5), (0.6, 1.2), (0.8, 0.5)])
def test_a_taper_that_the_rig_excludes_is_refused(
    place: float, load: float, random: np.random.Generator
) -> None:
    beam = bent(-0.4, place, load)
    refused = exact_fit(measured(beam, WIRE, random))
    assert refused.outcome is Outcome.INVALID
    assert "beam_shape" in refused.message
    assert exact_fit(measured(beam, ANY_TAPER, random)).outcome is Outcome.CONTACT


def test_a_friction_that_the_rig_excludes_is_refused(random: np.random.Generator) -> None:
    beam = bent(0.0, 0.6, 1.2, friction=0.5)
    polished = stated_shape(taper=0.0, softness=0.0, section=0.02, friction=0.02)
    refused = exact_fit(measured(beam, polished, random))
    assert refused.outcome is Outcome.INVALID
    assert "rig.json" in refused.message


def test_a_true_statement_is_not_refused(random: np.random.Generator) -> None:
    for _ in range(20):
        taper = 0.02 * float(random.standard_normal())
        beam = bent(taper, float(random.uniform(0.3, 0.9)), float(random.uniform(0.3, 1.2)))
        estimate = exact_fit(measured(beam, WIRE, random))
        assert estimate.outcome is Outcome.CONTACT, estimate.message


def with_tip(taper: float, place: float, load: float) -> Measurement:
    """A beam whose plane is unknown, but for the image of its tip."""
    beam = bent(taper, place, load)
    taken = measured(beam, WIRE, generator(__name__, 8))
    tip = Tip(beam.centreline[-1, 1:3], np.diag([2e-5, 2e-5]) ** 2)
    viewpoint = np.array([0.12, -0.1, 0.36, 1.0])
    return replace(taken, view=replace(taken.view, tip=tip, viewpoint=viewpoint))


@pytest.mark.thorough
@pytest.mark.parametrize("place", [0.4, 0.6, 0.8])
def test_a_taper_that_the_rig_excludes_is_refused_in_an_unknown_plane(place: float) -> None:
    refused = exact_fit_3d(with_tip(-0.2, place, 1.2))
    assert refused.outcome is Outcome.INVALID
    assert "beam_shape" in refused.message
    assert exact_fit_3d(with_tip(0.01, place, 1.2)).outcome is Outcome.CONTACT


@pytest.mark.false_alarm(2e-6, "binomial, more than 4 of 20 at 1 %; none of 280 courses")
def test_errors_that_neighbours_share_are_no_taper(random: np.random.Generator) -> None:
    frames = [disturbed(bent(0.05, 0.6, 1.2), 12, 2 * SIGMA, random) for _ in range(20)]
    assert sum("rig.json" in exact_fit(frame).message for frame in frames) <= 4


@pytest.mark.false_alarm(1e-6, "binomial, none of 12 at 69 %, the least of 150 courses each")
@pytest.mark.parametrize("taper", [-0.4, -0.1])
@pytest.mark.parametrize("place", [0.5, 0.9])
@pytest.mark.parametrize("load", [0.3, 1.2])
def test_a_taper_on_a_rig_that_states_a_uniform_beam(
    taper: float, place: float, load: float, random: np.random.Generator
) -> None:
    beam = bent(taper, place, load)
    outcomes = [exact_fit(measured(beam, UNIFORM, random)).outcome for _ in range(12)]
    assert not any(outcome.has_values for outcome in outcomes)
    # Some fits stop before a minimum: an iteration that does not converge names no assumption.
    assert Outcome.INVALID in outcomes
    assert {*outcomes} <= {Outcome.INVALID, Outcome.NOT_CONVERGED}


@pytest.mark.false_alarm(3e-6, "binomial, more than 5 of 20 at 2 %, as of 200 courses")
def test_errors_of_neighbours_on_a_uniform_beam_are_in_its_sigmas(
    random: np.random.Generator,
) -> None:
    in_sigmas = []
    beam = bent(0.0, 0.6, 1.2)
    for _ in range(20):
        taken = disturbed(beam, 12, SIGMA, random)
        estimate = exact_fit(replace(taken, rig=replace(taken.rig, shape=UNIFORM)))
        assert estimate.outcome is Outcome.CONTACT, estimate.message
        error = estimate.values["x_c_m"] - float(beam.points[0, 0])
        in_sigmas.append(error / estimate.sigma("x_c_m"))
    # Now and then a course looks like another place of the contact.
    assert np.count_nonzero(np.abs(in_sigmas) < 3) >= 15
    assert np.median(np.abs(in_sigmas)) < 1.5
