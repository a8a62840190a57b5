"""Random numbers of keys: functions of seed, key and number alone, and even where asked."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from vbaa_bench.scene.unit_values import Draw, Method, unit_value

SEEDS = st.integers(0, 2**63 - 1)


def values(count: int, method: Method, key: str = "beam.length_mm", seed: int = 1) -> np.ndarray:
    return np.array([unit_value(seed, method, Draw("rig", n), key) for n in range(count)])


@pytest.mark.thorough
@given(seed=SEEDS, key=st.text(max_size=20), exponent=st.integers(0, 7))
@settings(max_examples=30)
def test_sobol_has_one_value_in_each_equal_interval(seed: int, key: str, exponent: int) -> None:
    drawn = values(2**exponent, "sobol", key, seed)
    assert sorted(np.floor(2**exponent * drawn)) == list(range(2**exponent))


@pytest.mark.parametrize("method", ["uniform", "sobol"])
def test_numbers_are_uniform_over_keys_and_seeds(method: Method) -> None:
    drawn = [unit_value(n, method, Draw("rig", n), f"key {n}") for n in range(2000)]
    assert kstest(drawn, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("method", ["uniform", "sobol"])
def test_keys_are_independent(method: Method) -> None:
    """Of 8 keys, no pair is correlated, and no quadrant of the square is fuller than by chance."""
    columns = [values(1024, method, f"key.{i}") for i in range(8)]
    for one, other in itertools.combinations(columns, 2):
        assert abs(np.corrcoef(one, other)[0, 1]) < 4.5 / np.sqrt(1024)
        counts = np.histogram2d(one, other, bins=4)[0]
        chi_squared = float(((counts - 64) ** 2 / 64).sum())
        assert chi_squared < 50  # 15 degrees of freedom: a probability of 1e-5


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@given(seed=SEEDS, number=st.integers(0, 2**31), attempt=st.integers(1, 9))
def test_each_attempt_stream_and_key_has_its_own_number(
    seed: int, number: int, attempt: int
) -> None:
    first = unit_value(seed, "sobol", Draw("rig", number), "a")
    assert first == unit_value(seed, "sobol", Draw("rig", number), "a")
    others = [
        unit_value(seed, "sobol", Draw("rig", number, attempt), "a"),
        unit_value(seed, "sobol", Draw("push", number), "a"),
        unit_value(seed, "sobol", Draw("rig", number), "b"),
        unit_value(seed, "uniform", Draw("rig", number), "a"),
    ]
    assert first not in others
    assert len(set(others)) == 4
    assert all(0 <= value < 1 for value in (first, *others))
