import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import median_filter

from solver.centreline.smooth import curve, local_scatter, running_median


@given(
    values=st.lists(st.floats(-30, 30), min_size=1, max_size=80),
    half=st.integers(0, 30),
)
def test_the_running_median_is_scipys(values: list[float], half: int) -> None:
    array, width = np.array(values), 2 * half + 1
    expected = median_filter(array, width, mode="nearest")
    assert (running_median(array, width) == expected).all()


def test_there_is_no_running_median_of_nothing() -> None:
    assert len(running_median(np.empty(0), 21)) == 0


def test_outliers_do_not_pull_the_curve() -> None:
    x = np.linspace(3.0, 9.0, 100)
    truth = 0.3 * x**3 - x
    y = truth.copy()
    y[30:45] += 5.0
    fitted = curve(x, y, np.full(100, 1e-3), x, np.int64(5), 6.0)
    assert fitted == pytest.approx(truth, abs=1e-9)


@pytest.mark.parametrize("disturbance", ["none", "slow", "outliers"])
def test_the_local_scatter_is_that_of_the_noise(
    disturbance: str, random: np.random.Generator
) -> None:
    n = 20_000
    values = 0.3 * random.standard_normal(n)
    if disturbance == "slow":
        values += 2.0 * np.sin(np.arange(n) * 2 * np.pi / 500)
    if disturbance == "outliers":
        values[random.choice(n, n // 10, replace=False)] += 5.0
    # A tenth of outliers spoils 27 % of the differences: the median of |x| then lies at the 0.69
    # quantile of the others, which is 1.5 times as large. Their standard deviation is 5 times.
    most = 1.6 if disturbance == "outliers" else 1.1
    assert 0.9 < local_scatter(values) / 0.3 < most


def test_the_local_scatter_counts_errors_that_blocks_share(random: np.random.Generator) -> None:
    """Each point errs as its seven neighbours do: their differences alone show next to nothing."""
    blocks = np.repeat(random.standard_normal(5000), 8)
    assert local_scatter(blocks) == pytest.approx(1.0, rel=0.15)  # +- 0.018


def test_there_is_no_local_scatter_of_a_few_values() -> None:
    assert local_scatter(np.arange(7.0) ** 2) == 0.0
