"""Many noisy frames at once: errors against the information limit and what is stated."""

import numpy as np
import pytest

from solver.beam_models import frictional
from solver.fitting.batch import Batch, exact_fit_batch
from solver.instrument.arrays import Floats
from solver.methods.exact_fit import exact_fit
from tests.draws import generator
from tests.simulated import BEAM, measurement, pushed_points

SIGMA = 0.05 * 0.51e-3  # 0.05 px
TRIALS = 1500
KNOWN_BASE = np.diag([1e-9, 1e-9, 1e-8]) ** 2


def noisy(points: Floats, trials: int, seed: int = 0) -> Floats:
    """Frames (trials, n, 2) of the points with errors along y."""
    frames = np.tile(points, (trials, 1, 1))
    frames[:, :, 1] += SIGMA * generator(__name__, seed).standard_normal(frames.shape[:2])
    return frames


def fitted(frames: Floats, base: Floats = KNOWN_BASE) -> Batch:
    trials, n, _ = frames.shape
    sigmas = np.zeros((trials * n, 2))
    sigmas[:, 1] = SIGMA
    offsets = np.arange(trials + 1) * n
    return exact_fit_batch(frames.reshape(-1, 2), sigmas, offsets, base, BEAM)


def errors(batch: Batch, x_c: float, force: float) -> tuple[Floats, Floats]:
    """Errors (m, 2) of x_c and force, and the covariances (m, 2, 2) that are stated."""
    q, lever = batch.parameters[:, :2].T
    at = frictional.contact(q, lever, np.zeros_like(q))
    found = np.column_stack([at.x_c - x_c, q * BEAM.flexural_rigidity - force])
    jacobian = np.zeros((len(q), 2, 2))
    jacobian[:, 0], jacobian[:, 1, 0] = at.d_x_c[:2].T, BEAM.flexural_rigidity
    return found, jacobian @ batch.covariances[:, :2, :2] @ jacobian.transpose(0, 2, 1)


def judge(error: Floats, stated: Floats, limit: float, most: float = 1.15) -> None:
    rmse = np.sqrt(np.mean(error[:, 0] ** 2))
    assert 0.87 < rmse / limit < most
    # chi^2 of two degrees of freedom: 2 +- 0.05.
    assert 1.6 < mean_chi2(error, stated) < 2.4


def mean_chi2(error: Floats, stated: Floats) -> float:
    return float(np.mean((error * np.linalg.solve(stated, error[:, :, None])[:, :, 0]).sum(axis=1)))


def limit(points: Floats, x_c: float, force: float, base: Floats = KNOWN_BASE) -> float:
    """Cramer and Rao's bound of x_c [m]: the covariance at the truth, from noise-free points."""
    _, stated = errors(fitted(points[None], base), x_c, force)
    return float(np.sqrt(stated[0, 0, 0]))


@pytest.mark.thorough
@pytest.mark.parametrize(("distance", "deflection"), [(0.15, 0.1), (0.09, 0.2), (0.21, 0.05)])
def test_it_attains_the_information_limit_and_says_so(distance: float, deflection: float) -> None:
    points, x_c, force = pushed_points(distance, deflection)
    batch = fitted(noisy(points, TRIALS))
    assert batch.converged.all()
    judge(*errors(batch, x_c, force), limit(points, x_c, force))


@pytest.mark.thorough
def test_an_unknown_clamp_costs_what_it_must(random: np.random.Generator) -> None:
    points, x_c, force = pushed_points(0.15, 0.1)
    base = np.diag([2e-5, 2e-5, 2e-4]) ** 2
    frames = noisy(points, TRIALS)
    dx, dy, tilt = (np.sqrt(base[i, i]) * random.standard_normal((TRIALS, 1)) for i in range(3))
    turned = frames.copy()
    turned[:, :, 0] = dx + np.cos(tilt) * frames[:, :, 0] - np.sin(tilt) * frames[:, :, 1]
    turned[:, :, 1] = dy + np.sin(tilt) * frames[:, :, 0] + np.cos(tilt) * frames[:, :, 1]
    batch = fitted(turned, base)
    bound = limit(points, x_c, force, base)
    assert bound > 1.5 * limit(points, x_c, force)
    judge(*errors(batch, x_c, force), bound)


@pytest.mark.thorough
def test_two_fifths_of_gross_outliers_cost_little_more_than_their_points(
    random: np.random.Generator,
) -> None:
    points, x_c, force = pushed_points(0.15, 0.1)
    frames = noisy(points, 700)
    off = random.random(frames.shape[:2]) < 0.4
    frames[off, 1] += random.uniform(-5e-3, 5e-3, int(off.sum()))
    batch = fitted(frames)
    assert batch.converged.all()
    error, stated = errors(batch, x_c, force)
    bound = limit(points, x_c, force)
    assert (
        1.0 < np.sqrt(np.mean(error[:, 0] ** 2)) / bound < 1.7
    )  # 1.29 by the points that are lost
    assert 1.6 < mean_chi2(error, stated) < 2.4  # 2 +- 0.08


@pytest.mark.thorough
def test_one_frame_alone_gets_the_same_answer() -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    frames = noisy(points, 3)
    batch = fitted(frames)
    alone = exact_fit(measurement(frames[1], SIGMA))
    assert alone.values["force_n"] == pytest.approx(
        batch.parameters[1, 0] * BEAM.flexural_rigidity, rel=1e-12
    )
    assert alone.sigma("force_n") == pytest.approx(
        np.sqrt(batch.covariances[1, 0, 0]) * BEAM.flexural_rigidity, rel=1e-6
    )


def test_frames_may_differ_in_length_or_be_empty() -> None:
    points, _, force = pushed_points(0.15, 0.1)
    frame = noisy(points, 1)[0]
    both = np.vstack([frame, frame[::2]])
    sigmas = np.tile([0.0, SIGMA], (len(both), 1))
    offsets = [0, len(frame), len(frame), len(both)]
    batch = exact_fit_batch(both, sigmas, offsets, KNOWN_BASE, BEAM)
    assert batch.converged.tolist() == [True, False, True]
    forces = batch.parameters[[0, 2], 0] * BEAM.flexural_rigidity
    assert forces == pytest.approx(force, rel=0.02)


def test_what_is_not_finite_is_refused() -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    frames = noisy(points, 2)
    frames[1, 7, 0] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        fitted(frames)
    with pytest.raises(ValueError, match="offsets"):
        exact_fit_batch(points, points, [5, 0], KNOWN_BASE, BEAM)
