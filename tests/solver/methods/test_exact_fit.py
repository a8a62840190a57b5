import numpy as np
import pytest

from solver.instrument.estimate import Outcome
from solver.methods.exact_fit import exact_fit
from tests.simulated import BEAM, measurement, pushed_points

SIGMA = 0.05 * 0.51e-3  # 0.05 px


@pytest.mark.parametrize("deflection", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("distance", [0.03, 0.12, 0.21])
def test_recovers_a_noise_free_beam(distance: float, deflection: float) -> None:
    points, x_c, force = pushed_points(distance, deflection)
    answer = exact_fit(measurement(points, SIGMA))
    assert answer.outcome is Outcome.CONTACT
    assert answer.values["x_c_m"] == pytest.approx(x_c, abs=1e-6 * BEAM.length)
    assert answer.values["force_n"] == pytest.approx(force, rel=1e-5)


@pytest.mark.parametrize("base_sigma", [0.0, 2e-5])
def test_its_covariance_is_honest(base_sigma: float) -> None:
    points, x_c, force = pushed_points(0.15, 0.1)
    random = np.random.default_rng(7)
    squares, errors, stated = [], [], []
    for _ in range(200):
        shift, tilt = (
            base_sigma * random.standard_normal(),
            base_sigma * 10 * random.standard_normal(),
        )
        noisy = points.copy()
        noisy[:, 1] += SIGMA * random.standard_normal(len(points)) + shift + tilt * points[:, 0]
        answer = exact_fit(measurement(noisy, SIGMA, base_sigma))
        error = np.array([answer.values["x_c_m"] - x_c, answer.values["force_n"] - force])
        assert answer.covariance is not None
        covariance = answer.covariance[np.ix_([0, 3], [0, 3])]
        squares.append(error @ np.linalg.solve(covariance, error))
        errors.append(error[0])
        stated.append(answer.sigma("x_c_m"))
    # The covariance is widened by the noise's own scatter, a few per cent: never optimistic.
    assert 1.2 < np.mean(squares) < 2.2  # chi^2 of two degrees of freedom, 200 trials: 2 +- 0.14
    # 200 trials: 1 +- 0.05
    assert 0.85 < np.sqrt(np.mean(np.square(errors))) / np.mean(stated) < 1.15


def test_tolerances_of_the_rig_enter_the_covariance() -> None:
    points, x_c, force = pushed_points(0.15, 0.1)
    exact = exact_fit(measurement(points, 1e-8))
    vague = exact_fit(measurement(points, 1e-8, scale_sigma=1e-3))
    assert exact.sigma("x_c_m") < 1e-6
    assert vague.sigma("x_c_m") == pytest.approx(1e-3 * x_c, rel=1e-3)
    assert vague.sigma("force_n") == pytest.approx(2e-3 * force, rel=1e-3)


def test_a_straight_beam_is_no_contact() -> None:
    x = np.arange(0.003, 0.24, 0.51e-3)
    random = np.random.default_rng(1)
    outcomes = [
        exact_fit(measurement(np.column_stack([x, SIGMA * random.standard_normal(len(x))]), SIGMA))
        for _ in range(50)
    ]
    assert sum(answer.outcome is Outcome.NO_CONTACT for answer in outcomes) >= 48
    assert all(not answer.values or answer.outcome is Outcome.WEAK_CONTACT for answer in outcomes)


def test_a_faint_contact_is_only_an_interval() -> None:
    points, x_c, _ = pushed_points(0.12, 0.0002)
    noisy = points + np.array([0, 1]) * SIGMA * np.random.default_rng(3).standard_normal(
        (len(points), 1)
    )
    answer = exact_fit(measurement(noisy, SIGMA))
    assert answer.outcome is Outcome.WEAK_CONTACT
    assert abs(answer.values["x_c_m"] - x_c) < 3 * answer.sigma("x_c_m")


def test_a_contact_near_the_tip_is_flagged() -> None:
    points, _, _ = pushed_points(0.2399, 0.02)
    assert exact_fit(measurement(points, SIGMA)).outcome is Outcome.TIP_CONTACT


def test_impossible_shapes_are_refused() -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    bent_back = points * [1, -1]
    assert exact_fit(measurement(bent_back, SIGMA)).outcome is Outcome.INVALID
    # The same shape on a shorter beam would be touched beyond its tip.
    stretched = points * 1.7
    assert exact_fit(measurement(stretched, SIGMA)).outcome is Outcome.INVALID


def test_too_few_points_do_not_identify_a_contact() -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    for count in (0, 1, 7):
        answer = exact_fit(measurement(points[:count], SIGMA))
        assert answer.outcome is Outcome.NOT_IDENTIFIABLE
        assert answer.message


def test_only_the_first_fifth_visible_gives_an_honest_huge_covariance() -> None:
    points, x_c, _ = pushed_points(0.15, 0.1)
    near = points[points[:, 0] < 0.048]
    near = near + np.array([0, 1]) * SIGMA * np.random.default_rng(5).standard_normal(
        (len(near), 1)
    )
    answer = exact_fit(measurement(near, SIGMA, base_sigma=1e-6))
    if answer.values:
        assert answer.sigma("x_c_m") > 0.02 * BEAM.length
        assert abs(answer.values["x_c_m"] - x_c) < 4 * answer.sigma("x_c_m")
    else:
        assert answer.outcome in (Outcome.NOT_IDENTIFIABLE, Outcome.INVALID, Outcome.NOT_CONVERGED)


def test_order_and_repetition_of_points_do_not_matter() -> None:
    points, x_c, _ = pushed_points(0.1, 0.1)
    shuffled = np.random.default_rng(2).permutation(points)
    one, other = exact_fit(measurement(points, SIGMA)), exact_fit(measurement(shuffled, SIGMA))
    assert one.values["x_c_m"] == pytest.approx(other.values["x_c_m"], abs=1e-9)
    twice = exact_fit(measurement(np.repeat(points, 2, axis=0), SIGMA))
    assert twice.values["x_c_m"] == pytest.approx(x_c, abs=1e-6)
