"""Many noisy frames: errors of `exact_fit` against the information limit and what is stated."""

from typing import NamedTuple

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.methods.exact_fit import exact_fit
from tests.draws import generator
from tests.simulated import measurement, pushed_points

SIGMA = 0.05 * 0.51e-3  # 0.05 px
TRIALS = 1500


class Fitted(NamedTuple):
    """Values (m, 2) of x_c [m] and force [N], and their covariances (m, 2, 2)."""

    values: Floats
    covariances: Floats


def noisy(points: Floats, trials: int, seed: int = 0) -> Floats:
    """Frames (trials, n, 2) of the points with errors along y."""
    frames = np.tile(points, (trials, 1, 1))
    frames[:, :, 1] += SIGMA * generator(__name__, seed).standard_normal(frames.shape[:2])
    return frames


def fitted(frames: Floats, base_sigma: float = 0.0) -> Fitted:
    values, covariances = [], []
    for points in frames:
        estimate = exact_fit(measurement(points, SIGMA, base_sigma))
        assert estimate.outcome is Outcome.CONTACT
        names = list(estimate.values)
        at = [names.index(name) for name in ("x_c_m", "force_n")]
        values.append([estimate.values[names[i]] for i in at])
        assert estimate.covariance is not None
        covariances.append(estimate.covariance[np.ix_(at, at)])
    return Fitted(np.array(values), np.array(covariances))


def judge(found: Fitted, truth: tuple[float, float], bound: float, most: float = 1.15) -> None:
    error = found.values - truth
    rmse = np.sqrt(np.mean(error[:, 0] ** 2))
    assert 0.87 < rmse / bound < most
    # chi^2 of two degrees of freedom: 2 +- 0.05.
    assert 1.6 < mean_chi2(error, found.covariances) < 2.4


def mean_chi2(error: Floats, stated: Floats) -> float:
    return float(np.mean((error * np.linalg.solve(stated, error[:, :, None])[:, :, 0]).sum(axis=1)))


def limit(points: Floats, base_sigma: float = 0.0) -> float:
    """Cramer and Rao's bound of x_c [m]: the covariance at the truth, from noise-free points."""
    return float(np.sqrt(fitted(points[None], base_sigma).covariances[0, 0, 0]))


@pytest.mark.thorough
@pytest.mark.parametrize(("distance", "deflection"), [(0.15, 0.1), (0.09, 0.2), (0.21, 0.05)])
def test_it_attains_the_information_limit_and_says_so(distance: float, deflection: float) -> None:
    points, *truth = pushed_points(distance, deflection)
    judge(fitted(noisy(points, TRIALS)), (truth[0], truth[1]), limit(points))


@pytest.mark.thorough
def test_an_unknown_clamp_costs_what_it_must(random: np.random.Generator) -> None:
    points, x_c, force = pushed_points(0.15, 0.1)
    sigma, frames = 2e-5, noisy(points, TRIALS)
    sigmas = sigma, sigma, 10 * sigma
    dx, dy, tilt = (one * random.standard_normal((TRIALS, 1)) for one in sigmas)
    turned = frames.copy()
    turned[:, :, 0] = dx + np.cos(tilt) * frames[:, :, 0] - np.sin(tilt) * frames[:, :, 1]
    turned[:, :, 1] = dy + np.sin(tilt) * frames[:, :, 0] + np.cos(tilt) * frames[:, :, 1]
    bound = limit(points, sigma)
    assert bound > 1.5 * limit(points)
    judge(fitted(turned, sigma), (x_c, force), bound)


@pytest.mark.thorough
def test_a_third_of_gross_outliers_costs_little_more_than_their_points(
    random: np.random.Generator,
) -> None:
    points, x_c, force = pushed_points(0.15, 0.1)
    frames = noisy(points, 700)
    off = random.random(frames.shape[:2]) < 1 / 3
    frames[off, 1] += random.uniform(-5e-3, 5e-3, int(off.sum()))
    found = fitted(frames)
    error = found.values - [x_c, force]
    # 1.22 by the points that are lost.
    assert 1.0 < np.sqrt(np.mean(error[:, 0] ** 2)) / limit(points) < 1.5
    assert 1.6 < mean_chi2(error, found.covariances) < 2.4  # 2 +- 0.08
