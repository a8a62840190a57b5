import numpy as np
import pytest

from solver.calibrate import Calibration
from solver.centreline import Centreline, down_columns
from solver.instrument.errors import InputError
from solver.rest import learn_rest
from tests.simulated import BEAM, rig
from tests.solver.test_sag import CAMERA

SIGMA_PX = 0.01
X = np.linspace(0.004, 0.238, 420)


def lines(y: np.ndarray, random: np.random.Generator, count: int = 4) -> list[Centreline]:
    """Images of a beam that lies along y(x) [m] on C: one point a column, with noise."""
    pixels = CAMERA.project(np.column_stack([X, y, np.zeros_like(X)]))
    columns = np.arange(np.ceil(pixels[0, 0]), np.floor(pixels[-1, 0]))
    rows = np.interp(columns, pixels[:, 0], pixels[:, 1])
    sigma = np.full(len(columns), SIGMA_PX)
    return [
        down_columns(
            np.column_stack([columns, rows + SIGMA_PX * random.standard_normal(len(rows))]), sigma
        )
        for _ in range(count)
    ]


def test_a_straight_beam_is_a_line_with_honest_covariance() -> None:
    random, errors = np.random.default_rng(0), []
    for _ in range(100):
        rest = learn_rest(lines(2e-5 + 1e-3 * X, random), Calibration(CAMERA, 0.02), rig())
        assert rest.straight
        error = np.array([rest.y_at_clamp - 2e-5, rest.slope - 1e-3])
        errors.append(error @ np.linalg.solve(rest.line_covariance, error))
    assert 1.4 < np.mean(errors) < 2.7  # chi^2 of two degrees of freedom: 2 +- 0.2


def test_a_bow_is_found_and_told_apart_from_the_clamp() -> None:
    random = np.random.default_rng(1)
    bow = 3e-4 * (X / BEAM.length) ** 2
    rest = learn_rest(lines(1e-3 * X + bow, random), Calibration(CAMERA, 0.02), rig())
    assert not rest.straight
    found, sigma = rest.bow_at(X)
    whole = rest.y_at_clamp + rest.slope * X + found
    assert np.abs(whole - 1e-3 * X - bow).max() < 2e-6
    assert sigma.max() < 2e-6
    # Slope and bow vary together; the line through the curve's error is known far better.
    assert rest.line_covariance[1, 1] < rest.covariance[1, 1] / 25


def test_too_few_columns_are_a_sentence() -> None:
    few = [down_columns(np.array([[30.0, 250.0], [31.0, 250.0]]), np.full(2, SIGMA_PX))]
    with pytest.raises(InputError, match="2 columns of the beam, needed are 10"):
        learn_rest(few, Calibration(CAMERA, 0.02), rig())
