import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.medians import median


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
