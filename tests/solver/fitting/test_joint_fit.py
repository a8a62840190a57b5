"""The normal equations of a joint fit: their covariance, and the mean friction of its frames."""

import numpy as np
import pytest

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.beams.stretch import WIDTHS
from solver.core.least_squares import BorderedEquations
from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.fitting.joint_fit import JointProblem, fit_jointly
from solver.fitting.rigid_object import with_friction_sign
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import stated_shape
from solver.uniform.problem import problem_of
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.tapered import bent, measured

FRICTION = 0.2


def test_a_direction_that_the_frames_absorb_has_a_large_variance() -> None:
    # The second shared parameter is absorbed by the frame's own, but for rounding below zero.
    own = np.array([[[0.1 + 0.2]]])
    mixed = np.array([[[0.0, 0.3]]])
    shared = np.diag([4.0, 0.3])
    assert shared[1, 1] - mixed[0, 0, 1] ** 2 / own[0, 0, 0] < 1e-15
    at = BorderedEquations(np.zeros(3), 0.0, shared, own, mixed, np.zeros(2), np.zeros((1, 1)))
    covariance = at.shared_covariance()
    assert covariance is not None
    assert covariance[0, 0] == pytest.approx(0.25)
    assert covariance[1, 1] > 1e10
    assert np.linalg.eigvalsh(covariance).min() > 0


def problems(friction: float) -> tuple[list[FrameProblem], Floats]:
    """Six contacts of this friction on a beam whose taper is not known, and their starts."""
    random, shape = generator(__name__, 3), stated_shape(0.1, 0.0, 0.0, FRICTION)
    frames, starts = [], []
    for place in (0.45, 0.6, 0.8):
        for strength in (0.15, 0.3):
            load = 3 * strength / place**2
            frame = measured(bent(0.0, place, load, friction), shape, random)
            frames.append(frame_problem_of(frame, problem_of(frame, with_tip=False)))
            starts.append([[load, place, 0.0]])
    return frames, np.array(starts)


@pytest.mark.parametrize("directions", [(1, 1, 1, 1, 1, 1), (-1, 1, 0, 1, -1, 1)])
def test_the_gradient_by_the_mean_friction_is_that_of_the_objective(
    directions: tuple[int, ...],
) -> None:
    frames, starts = problems(0.1)
    if 0 in directions:
        frames = [with_friction_sign(*one) for one in zip(frames, directions, strict=True)]
    first = frames[0]
    own = np.array([Q, S_C, FRICTION_RATIO])
    shared = np.array([i for i in first.free if i not in own])
    p = np.tile(first.mean, (len(frames), 1))
    p[:, own] = starts[:, 0]
    p[:, FRICTION_RATIO] = np.linspace(0.0, 0.1, len(frames))
    step = 1e-3
    joint = JointProblem(frames, p, own, shared)

    def system(friction_ratio: float) -> BorderedEquations | None:
        parameters = joint.start.copy()
        parameters[len(shared)] = friction_ratio
        return joint.system(parameters)

    behind, at, ahead = (
        system(friction_ratio) for friction_ratio in (0.05 - step, 0.05, 0.05 + step)
    )
    assert behind is not None
    assert at is not None
    assert ahead is not None
    slope = (ahead.objective - behind.objective) / (2 * step)
    assert slope == pytest.approx(2 * at.shared_gradient[-1], rel=1e-6)
    curvature = (ahead.objective - 2 * at.objective + behind.objective) / step**2
    assert curvature == pytest.approx(2 * at.shared[-1, -1], rel=1e-4)


def test_objects_that_are_equally_rough_do_not_bias_the_taper_beyond_its_sigma() -> None:
    frames, starts = problems(2 * FRICTION)
    fit = fit_jointly(frames, frames[0].mean, starts)
    assert fit is not None
    assert fit.converged
    taper = list(fit.shared).index(WIDTHS)
    sigma = np.sqrt(fit.covariance[taper, taper])
    assert abs(fit.frames[0, WIDTHS]) < MOST_SIGMAS * sigma
