from collections.abc import Sequence

import numpy as np
import pytest

from solver.instrument.beam_shape import FIRST_WIDTH, SOFTNESS, BeamShape, stated_shape
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement
from solver.learning.candidates import Candidate, candidates_of, prior_of
from solver.learning.comparison import Trial, simplest
from solver.learning.learn import learn_beam
from solver.learning.page import page, summary, widths_of
from solver.methods.exact_fit import exact_fit
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM, rig
from tests.tapered import bent, measured

SOFT = Candidate(0, True)
PLACES = (0.35, 0.5, 0.62, 0.75, 0.88)


def pushes(
    taper: float,
    shape: BeamShape,
    softness: float = 0.0,
    friction: float = 0.0,
    places: Sequence[float] = PLACES,
) -> list[list[Measurement]]:
    """Three frames at each place, of a clamp that turns by `softness` times its moment."""
    random = generator(__name__, 11)
    frames = []
    for place in places:
        push = []
        for strength in (0.1, 0.2, 0.3):
            # A load that deflects a uniform beam by this share of its length.
            beam = bent(taper, place, 3 * strength / place**2, friction)
            moment = -beam.base_moment[2] * BEAM.length / BEAM.flexural_rigidity
            push.append(measured(beam, shape, random, tilt=softness * moment))
        frames.append(push)
    return frames


@pytest.mark.thorough
def test_a_cone_is_learned_from_unknown_contacts() -> None:
    learned = learn_beam(pushes(-0.1, stated_shape(0.03, 0.0, 0.0, 0.0)))
    assert learned.chosen.widths >= 1
    assert not learned.chosen.stated  # it is thinner than the rig allows
    width, sigma = widths_of(learned.shape)
    assert sigma[-1] < 0.01
    assert abs(width[-1] - 0.9) < MOST_SIGMAS * sigma[-1]
    assert learned.misfit == pytest.approx(1, abs=0.1)
    assert "width at the tip" in summary(learned, rig(), rig())
    assert page(learned, rig(), rig()).count("<svg") == 2


@pytest.mark.thorough
def test_a_beam_that_was_learned_is_estimated_more_accurately(random: np.random.Generator) -> None:
    stated = stated_shape(0.1, 0.0, 0.0, 0.0)
    learned = learn_beam(pushes(-0.1, stated))
    beam = bent(-0.1, 0.7, 0.6)
    before, after = (exact_fit(measured(beam, shape, random)) for shape in (stated, learned.shape))
    assert after.sigma("x_c_m") < 0.6 * before.sigma("x_c_m")
    for estimate in (before, after):
        assert abs(estimate.values["x_c_m"] - beam.points[0, 0]) < MOST_SIGMAS * estimate.sigma(
            "x_c_m"
        )


def test_what_the_pushes_do_not_determine_keeps_its_prior() -> None:
    stated = stated_shape(0.002, 0.0, 0.0, 0.0)
    few = [push[:1] for push in pushes(0.0, stated, places=PLACES[:2])]
    learned = learn_beam(few)
    assert learned.chosen.stated
    assert "as far as the rig states" in summary(learned, rig(), rig())
    assert 0.001 < learned.shape.sigma(FIRST_WIDTH) < 0.002


@pytest.mark.parametrize("clamp", [0.0, 0.003])
@pytest.mark.parametrize("taper", [0.0, 0.02])
def test_the_first_candidate_is_within_what_the_rig_states(clamp: float, taper: float) -> None:
    stated = stated_shape(taper, clamp, 0.0, 0.0)
    first = candidates_of(stated)[0]
    assert first.stated == bool(taper or clamp)
    prior = prior_of(first, stated)
    assert prior.sigma(SOFTNESS) == clamp
    widths = [prior.sigma(FIRST_WIDTH + i) for i in range(len(prior.widths))]
    assert widths == [taper] * len(stated.widths)
    assert sum(candidate.stated for candidate in candidates_of(stated)) == first.stated


@pytest.mark.thorough
def test_a_uniform_beam_on_a_rigid_clamp_needs_nothing_more() -> None:
    learned = learn_beam(pushes(0.0, BeamShape()))
    assert (learned.chosen.widths, learned.chosen.soft) == (0, False)


@pytest.mark.thorough
def test_a_clamp_that_gives_is_learned() -> None:
    rigid, soft = learn_beam(pushes(0.0, BeamShape(), softness=0.01)).trials[:2]
    assert soft.candidate.soft
    assert soft.misfit < 0.2 * rigid.misfit
    # Five pushes are too few to prefer it safely: the misfit of a rigid clamp differs too much
    # between them.
    learned = learn_beam(pushes(0.0, stated_shape(0.0, 0.05, 0.0, 0.0), softness=0.01))
    assert learned.chosen.soft
    sigma = learned.shape.sigma(SOFTNESS)
    assert learned.shape.softness == pytest.approx(0.01, abs=5 * sigma)
    assert sigma < 1e-3


@pytest.mark.thorough
def test_of_rigid_objects_friction_is_learned() -> None:
    stated = stated_shape(0.0, 0.0, 0.0, 0.3, rigid_objects=True)
    learned = learn_beam(pushes(0.0, stated, friction=0.5))
    coefficient, sigma = learned.shape.friction
    assert abs(coefficient - 0.5) < 0.5 * sigma < 0.1
    assert sigma < stated.friction.sigma
    assert f"objects like these: {coefficient:.2f} +- {sigma:.2f}" in summary(learned, rig(), rig())
    beam = bent(0.0, 0.7, 0.6, 0.5)
    shifts = []
    for number in range(8):
        # The same noise: it is larger than what the friction moves.
        before, after = (
            exact_fit(measured(beam, shape, generator(__name__, number)))
            for shape in (stated, learned.shape)
        )
        assert after.sigma("x_c_m") < before.sigma("x_c_m")
        shifts.append(after.values["x_c_m"] - before.values["x_c_m"])
    # Before, it was 0.03 mm too near.
    assert 1e-5 < np.mean(shifts) < 7e-5


def test_friction_of_objects_that_may_yield_is_not_learned() -> None:
    stated = stated_shape(0.0, 0.0, 0.0, 0.3)
    learned = learn_beam(pushes(0.0, stated, friction=0.3, places=PLACES[:2])).shape
    assert (learned.friction_coefficient, learned.friction_sigma) == (0.0, 0.3)


def test_objects_that_are_stated_as_smooth_stay_so() -> None:
    stated = stated_shape(0.0, 0.0, 0.0, 0.0, rigid_objects=True)
    learned = learn_beam(pushes(0.0, stated, places=PLACES[:2])).shape
    assert (learned.friction_coefficient, learned.friction_sigma) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("certain", "worst", "kept"),
    [(Candidate(0, False), 0.9, True), (Candidate(0, False), 1.5, False), (SOFT, 0.9, False)],
)
def test_only_a_certain_beam_is_kept_against_a_better_one_and_only_within_the_sigmas(
    certain: Candidate, worst: float, kept: bool, random: np.random.Generator
) -> None:
    """The cone is better by a hundred errors of the difference: pushes that share errors do so."""
    misfits = np.append(random.uniform(0.2, 0.8, 4), worst)
    trials = [
        Trial(certain, misfits, excess=0.01, excess_error=1e-4, noise=1e-3),
        Trial(Candidate(2, False), misfits - 0.01, excess=0.0, excess_error=0.0, noise=1e-3),
    ]
    assert (simplest(trials) == certain) == kept


def test_too_few_pushes_are_refused() -> None:
    frames = pushes(0.0, BeamShape(), places=PLACES[:1])
    with pytest.raises(InputError, match="1 of 1 pushes show a contact, needed are 2"):
        learn_beam(frames)


def test_what_the_rig_states_is_in_every_candidate() -> None:
    stated = stated_shape(0.05, 0.01, 0.0, 0.2)
    candidates = candidates_of(stated)
    assert all(candidate.widths and candidate.soft for candidate in candidates)
    sizes = [candidate.size for candidate in candidates_of(BeamShape())]
    assert sizes == sorted(sizes)
    assert sizes[0] == 0
    prior = prior_of(candidates[-1], stated)
    assert prior.friction_sigma == 0.2
    assert len(prior.widths) == candidates[-1].widths
