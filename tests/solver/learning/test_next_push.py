"""The push that helps most: what is predicted of it, and what it brings."""

from dataclasses import replace

import numpy as np
import pytest

from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.instrument.beam_shape import FIRST_WIDTH, BeamShape, stated_shape
from solver.instrument.measurement import Measurement
from solver.learning.learn import learn_beam
from solver.learning.next_push import DEFLECTIONS, PLACES, next_push
from solver.learning.page import summary
from solver.uniform.problem import problem_of
from tests.draws import generator
from tests.simulated import rig
from tests.tapered import bent, measured


def problem_with(shape: BeamShape) -> FrameProblem:
    measurement = measured(bent(-0.05, 0.7, 0.6), shape, generator(__name__, 2))
    return frame_problem_of(measurement, problem_of(measurement, with_tip=False))


def test_a_beam_without_uncertain_parameters_needs_no_push() -> None:
    assert next_push(problem_with(BeamShape()), 1.0) is None


def test_a_push_helps_the_more_the_less_the_beam_is_known() -> None:
    vague = next_push(problem_with(stated_shape(0.1, 0.0, 0.0, 0.0)), 1.0)
    sharp = next_push(problem_with(stated_shape(1e-5, 0.0, 0.0, 0.0)), 1.0)
    assert vague is not None
    assert sharp is not None
    assert vague.place in PLACES
    assert vague.deflection == max(DEFLECTIONS)
    assert vague.after < 0.5 * vague.before
    assert sharp.after == pytest.approx(sharp.before, rel=1e-2)
    # Both have the sigma of a known beam when the taper is known.
    assert sharp.after < vague.after < 2 * sharp.after


def test_noise_makes_every_push_less_useful() -> None:
    problem = problem_with(stated_shape(0.1, 0.0, 0.0, 0.0))
    noisy = replace(problem, points=problem.points * np.array([1, 1, 3, 3])[:, None])
    for other in (next_push(noisy, 1.0), next_push(problem, 9.0)):
        one = next_push(problem, 1.0)
        assert one is not None
        assert other is not None
        assert other.before > one.before
        assert other.after > one.after


def test_the_push_that_is_advised_brings_about_what_is_predicted(
    random: np.random.Generator,
) -> None:
    """The taper's sigma after learning with the advised push, against one near the clamp."""
    stated = stated_shape(0.1, 0.0, 0.0, 0.0)

    def push(place: float, deflection: float) -> list[Measurement]:
        load = deflection / (place**2 / 2 - place**3 / 6)
        return [measured(bent(-0.05, place, load), stated, random)]

    few = [push(0.45, 0.05), push(0.5, 0.06)]
    learned = learn_beam(few)
    advice = learned.next_push
    assert advice is not None
    assert "the next push that helps most: contact at" in summary(learned, rig(), rig())

    def sigma(place: float, deflection: float) -> float:
        shape = learn_beam([*few, push(place, deflection)]).shape
        return shape.sigma(FIRST_WIDTH) if len(shape.widths) else 0.0

    assert sigma(advice.place, advice.deflection) < 0.6 * sigma(0.3, 0.05)
