import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import median_filter

from solver.centreline.smooth import running_median, smooth_curve


@given(
    values=st.lists(st.floats(-30, 30), min_size=1, max_size=80),
    half=st.integers(0, 30),
)
def test_the_running_median_is_scipys(values: list[float], half: int) -> None:
    width = 2 * half + 1
    expected = median_filter(np.array(values), width, mode="nearest")
    assert (running_median(np.array(values), width) == expected).all()


def test_there_is_no_running_median_of_nothing() -> None:
    assert len(running_median(np.empty(0), 21)) == 0


def test_outliers_do_not_pull_the_curve() -> None:
    x = np.linspace(3.0, 9.0, 100)
    curve = 0.3 * x**3 - x
    y = curve.copy()
    y[30:45] += 5.0
    found = smooth_curve(x, y, np.full(100, 1e-3), degree=5)
    assert found is not None
    assert found == pytest.approx(curve, abs=1e-9)
