"""The shift of an image, from the prior and the landmarks."""

import numpy as np
import pytest

from solver.at_rest.image_shift import image_shift
from solver.at_rest.landmarks import Shift
from solver.at_rest.thresholds import THRESHOLDS
from tests.consistency import MOST_SIGMAS


def test_without_landmarks_the_prior_remains() -> None:
    shift, covariance = image_shift(None, 0.3)
    assert not shift.any()
    assert covariance == pytest.approx(np.eye(2) * 0.09)


def test_prior_and_measurement_are_weighted_by_their_variances() -> None:
    """Two normal variables along each axis (closed form)."""
    measured = Shift(0.4, -0.2, 0.01, 0.0, 0.04)
    shift, covariance = image_shift(measured, 0.2)
    for axis, (value, variance) in enumerate(((0.4, 0.01), (-0.2, 0.04))):
        error = variance + THRESHOLDS.steadiness_px**2
        assert shift[axis] == pytest.approx(value * 0.04 / (0.04 + error))
        assert covariance[axis, axis] == pytest.approx(1 / (1 / 0.04 + 1 / error))


def test_drawn_shifts_are_as_far_off_as_stated(random: np.random.Generator) -> None:
    prior = 0.3
    error = np.array([[0.02, 0.012], [0.012, 0.03]])
    noise = error + np.eye(2) * THRESHOLDS.steadiness_px**2
    squares = []
    for _ in range(400):
        true = prior * random.standard_normal(2)
        seen = random.multivariate_normal(true, noise)
        measured = Shift(seen[0], seen[1], error[0, 0], error[0, 1], error[1, 1])
        shift, covariance = image_shift(measured, prior)
        squares.append((shift - true) @ np.linalg.solve(covariance, shift - true))
    assert np.mean(squares) == pytest.approx(2.0, abs=MOST_SIGMAS * 2 / np.sqrt(400))
