"""The direction of friction at a rigid object, against linear theory, and its prior."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import halfnorm

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.fitting.rigid_object import _growth, friction_sign_of, with_friction_sign
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BeamShape, stated_shape
from solver.instrument.estimate import Estimate
from solver.instrument.rig import ClampOffset
from solver.methods.exact_fit import exact_fit
from solver.methods.exact_fit_3d import exact_fit_3d
from solver.uniform.problem import problem_of
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM
from tests.tapered import bent, measured

SIGMA = 0.3
STATED = stated_shape(0.0, 0.0, 0.0, SIGMA, rigid_objects=True)
SLENDERNESS = BEAM.radius / BEAM.length


def problem_with(shape: BeamShape) -> FrameProblem:
    taken = measured(bent(0.0, 0.5, 1.0), shape, generator(__name__, 1))
    return frame_problem_of(taken, problem_of(taken, with_tip=False))


def parameters(problem: FrameProblem, place: float, angle: float) -> Floats:
    """A beam that an object at `place` [L] bends by a pushing angle [rad], in linear theory."""
    p = problem.mean.copy()
    p[[Q, S_C]] = 3 * angle / place**2, place
    return p


@pytest.mark.parametrize("place", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("part", [0.2, 0.9, 3.0])
def test_the_distance_grows_as_in_linear_theory(place: float, part: float) -> None:
    """In units of that at first contact, by one less the pushing angle over 2.5 r / x_0."""
    problem = problem_with(STATED)
    p = parameters(problem, place, part * 2.5 * SLENDERNESS / place)
    growth = _growth(problem, p)
    # By a load q the beam turns by q x_0^2 / 2, and is deflected by q x_0^3 / 3; the first load is
    # a thousandth.
    assert growth.first == pytest.approx(SLENDERNESS * place**2 / 6 * (1 - 1e-3 * part), rel=1e-3)
    assert growth.now / growth.first == pytest.approx(1 - part, abs=2e-3 * (1 + part))


@pytest.mark.parametrize(
    ("part", "direction"), [(0.1, -1), (0.9, -1), (1.05, 0), (1.15, 0), (1.3, 1), (20.0, 1)]
)
def test_near_the_reversal_the_contact_may_be_held(part: float, direction: int) -> None:
    place, problem = 0.6, problem_with(STATED)
    p = parameters(problem, place, part * 2.5 * SLENDERNESS / place)
    assert friction_sign_of(problem, p) == direction


def test_the_prior_is_that_of_the_coefficient() -> None:
    """Its size is distributed as that of a normal variable with the stated sigma."""
    problem = problem_with(STATED)
    for sign in (-1, 1):
        known = with_friction_sign(problem, sign)
        assert known.friction_sign == sign
        assert known.mean[FRICTION_RATIO] == pytest.approx(sign * halfnorm.mean(scale=SIGMA))
        assert 1 / known.information[FRICTION_RATIO, FRICTION_RATIO] == pytest.approx(
            halfnorm.var(scale=SIGMA)
        )
    held = with_friction_sign(problem, 0)
    assert held.friction_sign == 0
    assert (held.mean == problem.mean).all()
    assert (held.information == problem.information).all()
    assert problem.information[FRICTION_RATIO, FRICTION_RATIO] == pytest.approx(SIGMA**-2)


def test_without_a_direction_a_learned_coefficient_has_either_sign() -> None:
    learned = replace(STATED, friction_coefficient=0.4)
    problem = problem_with(learned)
    assert problem.mean[FRICTION_RATIO] == 0
    assert problem.information[FRICTION_RATIO, FRICTION_RATIO] == pytest.approx(
        1 / (0.4**2 + SIGMA**2)
    )
    known = with_friction_sign(problem, -1)
    assert known.mean[FRICTION_RATIO] == -0.4
    assert known.information[FRICTION_RATIO, FRICTION_RATIO] == pytest.approx(SIGMA**-2)


@pytest.mark.parametrize(
    "shape", [replace(STATED, rigid_objects=False), stated_shape(0.1, 0, 0, 0, rigid_objects=True)]
)
def test_without_the_statement_or_friction_nothing_is_known(shape: BeamShape) -> None:
    assert problem_with(shape).rigid is None


def answers(friction: float, sigma: float) -> list[Estimate]:
    """A bend beyond the reversal: direction not stated, stated, and without friction in the rig."""
    beam, stated = bent(0.0, 0.5, 1.2, friction), replace(STATED, friction_sigma=sigma)
    shapes = (replace(stated, rigid_objects=False), stated, replace(stated, friction_sigma=1e-6))
    return [exact_fit(measured(beam, shape, generator(__name__, 5))) for shape in shapes]


def test_at_a_rigid_object_one_image_is_more_accurate(random: np.random.Generator) -> None:
    """By a sixth, where the image itself hardly determines the coefficient."""
    beam, stated = bent(0.0, 0.5, 1.2, 0.05), replace(STATED, friction_sigma=0.05)
    pulls = []
    for _ in range(16):
        taken = measured(beam, stated, random)
        known = exact_fit(taken)
        unstated = replace(taken.rig, shape=replace(stated, rigid_objects=False))
        either = exact_fit(replace(taken, rig=unstated))
        assert known.sigma("x_c_m") < 0.9 * either.sigma("x_c_m")
        pulls.append((known.values["x_c_m"] - beam.points[0, 0]) / known.sigma("x_c_m"))
    # Bounds of chi^2 of 16 degrees of freedom, crossed once in 100 million runs.
    assert 0.2 < np.sqrt(np.mean(np.square(pulls))) < 2.1


def test_its_sigma_is_that_of_the_coefficient() -> None:
    # So small that the image itself hardly determines it.
    either, known, smooth = (one.sigma("x_c_m") ** 2 for one in answers(0.01, 0.02))
    assert (known - smooth) / (either - smooth) == pytest.approx(1 - 2 / np.pi, rel=0.1)


@pytest.mark.parametrize("side", [-1, 1])
def test_the_axis_is_in_the_beams_frame(side: int, random: np.random.Generator) -> None:
    taken = measured(bent(0.0, 0.5, 1.0), STATED, random)
    mirror = np.diag([1.0, side, side, 1.0])
    rig = replace(taken.rig, clamp_offset=ClampOffset(np.array([1e-3, 2e-3])))
    taken = replace(taken, rig=rig, antenna_from_beam=taken.antenna_from_beam @ mirror)
    problem = frame_problem_of(taken, problem_of(taken, with_tip=False))
    assert problem.rigid is not None
    expected = np.array([-1e-3, -side * 2e-3]) / BEAM.length
    np.testing.assert_allclose(problem.rigid.axis, expected, atol=1e-15)


def test_in_a_plane_of_unknown_inclination_the_direction_is_known_as_well() -> None:
    beam = bent(0.0, 0.5, 1.2, 0.2)
    either, known = (
        exact_fit_3d(measured(beam, shape, generator(__name__, 5)))
        for shape in (replace(STATED, rigid_objects=False), STATED)
    )
    assert known.sigma("x_c_m") < 0.95 * either.sigma("x_c_m")
    assert abs(known.values["x_c_m"] - float(beam.points[0, 0])) < MOST_SIGMAS * known.sigma(
        "x_c_m"
    )
