import numpy as np
import pytest
from scipy.signal import lfilter

from solver.core.correlation import correlation_length
from solver.fitting.gauss_newton import Linearised, gauss_newton
from solver.instrument.arrays import Floats


def test_a_linear_problem_is_solved_in_closed_form(random: np.random.Generator) -> None:
    # Columns of very different units, as a force and a length are.
    design = random.standard_normal((40, 3)) * [1e-6, 1.0, 1e6]
    truth = np.array([2e6, -1.0, 3e-6])
    data = design @ truth

    def residuals(p: Floats) -> Linearised:
        return design @ p - data, design

    fit = gauss_newton(residuals, np.zeros(3))
    assert fit.converged
    assert fit.iterations <= 2
    assert fit.parameters == pytest.approx(truth, rel=1e-9)
    expected = np.linalg.inv(design.T @ design)
    assert fit.covariance == pytest.approx(expected, rel=1e-6)


def test_a_curved_problem_converges_from_afar() -> None:
    t = np.linspace(0, 1, 20)

    def residuals(p: Floats) -> Linearised | None:
        if p[1] < 0:
            return None
        decay = np.exp(-p[1] * t)
        sigma = 1e-3
        return (p[0] * decay - 3 * np.exp(-2 * t)) / sigma, np.column_stack(
            [decay, -p[0] * t * decay]
        ) / sigma

    fit = gauss_newton(residuals, np.array([1.0, 0.1]))
    assert fit.converged
    assert fit.parameters == pytest.approx([3, 2], rel=1e-5)


def test_an_open_direction_is_reported() -> None:
    def residuals(p: Floats) -> Linearised:
        return np.array([p[0] + p[1] - 1.0, 0.0]), np.array([[1.0, 1.0], [0.0, 0.0]])

    assert gauss_newton(residuals, np.zeros(2)).rank_deficient


def test_a_start_outside_the_domain_is_refused() -> None:
    with pytest.raises(ValueError, match="domain"):
        gauss_newton(lambda _: None, np.zeros(2))


def test_correlation_length_of_a_markov_process(random: np.random.Generator) -> None:
    rho = 0.8
    kicks = random.standard_normal(2_000_000)
    values = lfilter([1.0], [1.0, -rho], kicks)
    # AR(1): 1 + 2 sum(rho^k) = (1 + rho) / (1 - rho)
    assert correlation_length(values) == pytest.approx((1 + rho) / (1 - rho), rel=0.1)
    assert correlation_length(kicks) < 1.1
    assert correlation_length(np.zeros(10)) == 1.0
