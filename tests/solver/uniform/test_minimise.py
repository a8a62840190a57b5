"""The inverse of normal equations, against numpy's."""

import numpy as np
import pytest

from solver.uniform.minimise import invert
from solver.uniform.residuals import PARAMETERS


def test_the_inverse_of_the_free_parameters_whatever_their_units(
    random: np.random.Generator,
) -> None:
    free = np.array([0, 1, 3, 5, 7])
    units = 10.0 ** random.uniform(-6, 6, 5)
    rows = random.standard_normal((20, 5))
    normal = np.full((PARAMETERS, PARAMETERS), np.nan)
    normal[np.ix_(free, free)] = rows.T @ rows * np.outer(units, units)
    covariance = np.empty((PARAMETERS, PARAMETERS))
    assert invert(normal, free, covariance)
    expected = np.zeros((PARAMETERS, PARAMETERS))
    expected[np.ix_(free, free)] = np.linalg.inv(rows.T @ rows) / np.outer(units, units)
    assert covariance == pytest.approx(expected, rel=1e-10, abs=0.0)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_direction_that_nothing_determines_is_told(scale: float) -> None:
    free = np.array([0, 1, 2])
    rows = np.array([[1.0, 2.0, 3.0], [0.0, 1.0, 1.0]]) * [1.0, scale, 1.0]
    normal, covariance = np.zeros((PARAMETERS, PARAMETERS)), np.empty((PARAMETERS, PARAMETERS))
    normal[:3, :3] = rows.T @ rows
    assert not invert(normal, free, covariance)
    assert invert(normal, free[:2], covariance)
    assert not invert(np.zeros_like(normal), free, covariance)
