"""Light that objects reflect onto the beam: its course along the beam, and its part in learning."""

from dataclasses import replace

import numpy as np
import pytest

from solver.fitting.frame_problem import REFLECTED, FrameProblem, frame_problem_of
from solver.fitting.reflected_light import (
    TouchedPlace,
    lit_by_object,
    lit_by_objects,
    reflection_matters,
)
from solver.instrument.beam_shape import stated_shape
from solver.instrument.measurement import Measurement
from solver.learning.learn import learn_beam
from solver.learning.page import widths_of
from solver.uniform.problem import problem_of
from solver.uniform.residuals import SIGMA_Y, X, Y
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM, columns, measurement
from tests.tapered import bent

# Of a point [m], with which the light matters: a hundredth of a pixel of a beam of 8 px.
SIGMA = 0.5e-6
STATED = stated_shape(0.1, 0.0, 0.0, 0.0)


def lit(place: float, load: float, light: float, random: np.random.Generator) -> Measurement:
    """A cone, its tip 10 % thinner, beside which an object moves the points by `light` [radii]."""
    beam = bent(-0.1, place, load)
    points = columns(beam.centreline)
    x, y = (points - beam.points[0, :2]).T / BEAM.length / 0.05
    points[:, 1] += light * BEAM.radius / (1 + x**2 + y**2)
    points[:, 1] += SIGMA * random.standard_normal(len(points))
    taken = measurement(points, SIGMA, base_sigma=2e-6)
    return replace(taken, rig=replace(taken.rig, shape=STATED))


def problem() -> FrameProblem:
    taken = lit(0.6, 0.8, 0.0, generator(__name__, 1))
    return frame_problem_of(taken, problem_of(taken, with_tip=False))


def test_the_light_is_strongest_at_the_contact_and_odd_about_it_in_part() -> None:
    dark = problem()
    assert reflection_matters(dark)
    i = 200
    here = dark.points[[X, Y], i]
    shared = lit_by_object(dark, TouchedPlace(here, np.array([1.0, 0.0]))).shared[:, -2:]
    one = REFLECTED * dark.beam.radius / dark.points[SIGMA_Y, i]
    np.testing.assert_allclose(shared[i], [one, 0.0], rtol=1e-6)
    away = np.hypot(*(dark.points[[X, Y]] - here[:, None]))
    half = int(np.argmin(np.abs(away - 0.05)))
    assert shared[half, 0] == pytest.approx(one / 2, rel=0.05)
    assert (shared[:i, 1] < 0).all()
    assert (shared[i + 1 :, 1] > 0).all()


def test_within_a_frame_the_light_of_many_objects_has_the_covariance_of_one() -> None:
    dark, touch = problem(), TouchedPlace(np.array([0.6, 0.05]), np.array([0.9, 0.1]))
    one, many = lit_by_object(dark, touch), lit_by_objects(dark, touch)
    np.testing.assert_allclose(many.shared @ many.shared.T, one.shared @ one.shared.T, atol=1e-12)
    assert one.own_errors == 2
    assert many.own_errors == 2
    assert many.common == one.common + 2  # half of it is the same in all frames


@pytest.mark.thorough
def test_objects_that_all_reflect_alike_do_not_bias_a_learned_beam_beyond_its_sigmas(
    random: np.random.Generator,
) -> None:
    pushes = [
        [lit(place, 3 * strength / place**2, 2 * REFLECTED, random) for strength in (0.1, 0.2, 0.3)]
        for place in (0.35, 0.5, 0.62, 0.75, 0.88)
    ]
    width, sigma = widths_of(learn_beam(pushes).shape)
    assert abs(width[-1] - 0.9) < MOST_SIGMAS * sigma[-1]
