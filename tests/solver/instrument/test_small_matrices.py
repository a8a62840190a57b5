import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.arrays import Floats
from solver.instrument.small_matrices import solve, solve_definite, whitening
from tests.draws import generator


def definite(size: int, seed: int) -> Floats:
    """Draw a positive definite matrix (n, n) with a condition number of up to 1e6."""
    random = generator(__name__, seed)
    axes, _ = np.linalg.qr(random.normal(size=(size, size)))
    return np.asarray(axes * 10 ** random.uniform(-3, 3, size) @ axes.T)


@given(size=st.integers(1, 8), seed=st.integers(0, 2**32))
def test_systems_are_solved_as_by_lapack(size: int, seed: int) -> None:
    matrix = definite(size, seed)
    x = generator(__name__, seed).normal(size=size)
    right = matrix @ x
    assert solve_definite(matrix.copy(), right)
    assert right == pytest.approx(x, abs=1e-8)


@given(size=st.integers(1, 8), seed=st.integers(0, 2**32))
def test_general_systems_are_solved_as_by_lapack(size: int, seed: int) -> None:
    random = generator(__name__, seed)
    matrix, right = random.normal(size=(size, size)), random.normal(size=size)
    matrix[0, 0] = 0.0 if size > 1 else 1.0  # elimination must exchange rows
    expected = np.linalg.solve(matrix, right)
    assert solve(matrix, right)
    assert right == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.ones((3, 3)), np.full((1, 1), np.nan)])
def test_a_singular_matrix_is_reported(matrix: Floats) -> None:
    assert not solve(matrix, np.ones(len(matrix)))


@given(size=st.integers(1, 8), seed=st.integers(0, 2**32))
def test_whitened_errors_have_unit_covariance(size: int, seed: int) -> None:
    covariance = definite(size, seed)
    white = whitening(covariance)
    assert white @ covariance @ white.T == pytest.approx(np.eye(size), abs=1e-8)
    assert np.triu(white, 1) == pytest.approx(0)


@pytest.mark.parametrize("matrix", [np.diag([1.0, -1.0]), np.ones((2, 2)), np.full((1, 1), np.nan)])
def test_a_matrix_that_is_not_definite_is_reported(matrix: Floats) -> None:
    assert not solve_definite(matrix.copy(), np.ones(len(matrix)))
    assert np.isnan(whitening(matrix)).all()
