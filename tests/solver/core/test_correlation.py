"""The integrated autocorrelation, against its definition."""

import numpy as np
import pytest
from scipy.signal import lfilter

from solver.core.correlation import correlation_length, field_correlation
from solver.instrument.arrays import Floats
from tests.draws import generator


def by_definition(residual: Floats) -> float:
    """The sum over all lags of the autocorrelation, tapered to six times the first zero."""
    n, centred = len(residual), residual - residual.mean()
    lagged = np.array([centred[: n - lag] @ centred[lag:] for lag in range(n)])
    first_zero = int(np.argmax(lagged < 0)) or n
    reach = min(6 * first_zero, max(n // 2, 1))
    taper = 1 - np.arange(reach) / reach
    return max(1.0, float((lagged[0] + 2 * taper[1:] @ lagged[1:reach]) / lagged[0]))


@pytest.mark.parametrize("n", [2, 3, 10, 400])
@pytest.mark.parametrize("neighbours", [1, 5, 40])
def test_it_is_the_tapered_sum_of_the_autocorrelation(n: int, neighbours: int) -> None:
    white = generator(__name__, n).standard_normal(n + neighbours)
    residual = 3.0 + np.convolve(white, np.ones(neighbours), "valid")[:n]
    assert correlation_length(residual) == pytest.approx(by_definition(residual), rel=1e-9)


def test_of_nothing_and_of_equal_residuals_it_is_one() -> None:
    assert correlation_length(np.empty(0)) == 1.0
    assert correlation_length(np.zeros(7)) == 1.0
    assert correlation_length(np.full(1, 2.0)) == 1.0


def test_of_a_markov_process_it_is_known(random: np.random.Generator) -> None:
    rho = 0.8
    kicks = random.standard_normal(2_000_000)
    values = lfilter([1.0], [1.0, -rho], kicks)
    # AR(1): 1 + 2 sum(rho^k) = (1 + rho) / (1 - rho)
    assert correlation_length(values) == pytest.approx((1 + rho) / (1 - rho), rel=0.1)
    assert correlation_length(kicks) < 1.1


def test_of_a_field_it_is_known_along_each_axis(random: np.random.Generator) -> None:
    rho = 0.5
    field = lfilter([1.0], [1.0, -rho], random.standard_normal((4000, 12, 60)))[:, :, 20:]
    assert field_correlation(field, 2) == pytest.approx(3.0, rel=0.03)
    assert field_correlation(field, 1) == pytest.approx(1.0, abs=0.03)
    gaps = np.where(random.uniform(size=field.shape) < 0.3, np.nan, field)
    assert field_correlation(gaps, 2) == pytest.approx(3.0, rel=0.03)
    assert field_correlation(np.zeros((3, 4)), 1) == 1.0


def test_of_lines_with_a_common_error_it_grows_with_them_up_to_half(
    random: np.random.Generator,
) -> None:
    """Bartlett's weights of n lines and lags up to n / 2 are summed."""
    n = 40
    field = np.broadcast_to(random.standard_normal(5), (n, 5))
    lags = np.arange(1, n // 2)
    expected = 1 + 2 * (1 - lags / n).sum()
    assert field_correlation(field, 0, tapered=True) == pytest.approx(expected)
