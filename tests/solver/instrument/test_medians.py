import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.medians import median, quantile


@given(values=st.lists(st.floats(allow_nan=False, width=16), min_size=1, max_size=80))
def test_the_median_is_numpys(values: list[float]) -> None:
    array = np.array(values)
    # Infinite values of opposite sign have no mean.
    with np.errstate(invalid="ignore"):
        expected = np.median(array)
    assert median(array) == pytest.approx(expected, nan_ok=True)
    assert array.tolist() == values


def test_there_is_no_median_of_nothing() -> None:
    assert np.isnan(median(np.empty(0)))


@given(
    values=st.lists(st.floats(-1e3, 1e3, width=16), min_size=1, max_size=80),
    share=st.floats(0.0, 1.0),
)
def test_the_quantile_is_numpys(values: list[float], share: float) -> None:
    array = np.array(values)
    assert quantile(array, share) == pytest.approx(np.quantile(array, share), rel=1e-9, abs=1e-9)
    assert array.tolist() == values
