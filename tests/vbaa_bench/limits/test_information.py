"""Sums and reductions of information: linear regression, priors, and undetermined parameters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.draws import generator
from vbaa_bench.limits.information import Information, pseudo_inverse

X = np.linspace(0.0, 2.0, 21)
# A line y = a + b x, measured at X with the sigma 0.1.
LINE = Information.of_readings(
    ("a", "b"), np.column_stack([np.ones_like(X), X]), np.full(len(X), 0.1)
)


def test_a_line_has_the_sigmas_of_regression() -> None:
    spread = ((X - X.mean()) ** 2).sum()
    expected = [0.1 * np.sqrt(1 / len(X) + X.mean() ** 2 / spread), 0.1 / np.sqrt(spread)]
    np.testing.assert_allclose(LINE.sigmas(np.eye(2)), expected, rtol=1e-12)
    # Where the slope is known, the mean remains.
    assert LINE.without({"b"}).sigmas(np.eye(1))[0] == pytest.approx(0.1 / np.sqrt(len(X)))


@given(st.integers(0, 2**32 - 1))
def test_elimination_is_a_block_of_the_covariance(seed: int) -> None:
    rows = generator(__name__, seed).standard_normal((9, 5))
    whole = Information(tuple("abcde"), rows.T @ rows)
    reduced = whole.eliminated({"b", "d"})
    assert reduced.names == ("a", "c", "e")
    covariance = np.linalg.inv(whole.matrix)[np.ix_([0, 2, 4], [0, 2, 4])]
    np.testing.assert_allclose(np.linalg.inv(reduced.matrix), covariance, rtol=1e-6)


def test_data_are_added_by_the_names_of_their_parameters() -> None:
    prior = Information.of_priors({"b": 0.5, "c": 2.0})
    total = LINE + prior
    assert total.names == ("a", "b", "c")
    expected = np.zeros((3, 3))
    expected[:2, :2] = LINE.matrix
    expected += np.diag([0.0, 4.0, 0.25])
    np.testing.assert_allclose(total.matrix, expected)
    np.testing.assert_allclose((LINE + LINE).matrix, 2 * LINE.matrix)


def test_what_no_data_determine_is_infinite_and_harms_nothing_else() -> None:
    # Only the sum of a and b is measured.
    total = Information.of_readings(
        ("a", "b", "c"), np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1e-6]]), np.array([0.1, 0.2])
    )
    quantities = total.gradients([{"a": 1.0}, {"a": 1.0, "b": 1.0}, {"c": 1e-6}])
    np.testing.assert_allclose(total.sigmas(quantities), [np.inf, 0.1, 0.2], rtol=1e-6)


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@given(st.integers(0, 2**32 - 1))
def test_priors_without_errors_reduce_the_spread_of_the_efficient_estimate(seed: int) -> None:
    """Weighted least squares with priors, whose covariance follows from the errors that vary."""
    random = generator(__name__, seed)
    rows, sigmas = random.standard_normal((8, 3)), random.uniform(0.1, 1.0, 8)
    prior = Information.of_priors({"b": 0.3, "c": 0.5})
    data = Information.of_readings(("a", "b", "c"), rows, sigmas)
    gain = np.linalg.inv((data + prior).matrix) @ (rows / sigmas[:, None] ** 2).T
    expected = np.sqrt(np.diag(gain @ np.diag(sigmas**2) @ gain.T))
    np.testing.assert_allclose((data + prior).sigmas(np.eye(3), prior), expected, rtol=1e-6)
    assert ((data + prior).sigmas(np.eye(3)) >= expected).all()


def test_parameters_are_functions_of_others() -> None:
    # a = 2 p + q and b = q, with q kept under its own name.
    mapped = LINE.renamed({"b": "q"}).mapped(("p", "q"), {"a": np.array([2.0, 1.0])})
    assert mapped.names == ("p", "q")
    jacobian = np.array([[2.0, 1.0], [0.0, 1.0]])
    np.testing.assert_allclose(mapped.matrix, jacobian.T @ LINE.matrix @ jacobian)


def test_a_pseudo_inverse_does_not_depend_on_units() -> None:
    units = np.array([1e-9, 1e6])
    scaled = LINE.matrix * np.outer(units, units)
    np.testing.assert_allclose(
        pseudo_inverse(scaled) * np.outer(units, units), np.linalg.inv(LINE.matrix), rtol=1e-9
    )


def test_a_sigma_of_zero_states_nothing() -> None:
    stated = Information.of_priors({"a": 0.5, "b": 0.0})
    assert stated.names == ("a",)
    assert stated.matrix == pytest.approx(np.array([[4.0]]))
    assert Information.of_priors({"b": 0.0}).names == ()
