"""Distributions: their quantiles are those of scipy, and no value is outside of its limits."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.stats import loguniform, randint, truncnorm, uniform

from vbaa_bench.scene.distributions import ADAPTER, elements

UNITS = np.linspace(0, 1, 101)


def quantiles(**node: Any) -> np.ndarray:
    distribution = ADAPTER.validate_python(node)
    return np.array([distribution.value(float(unit)) for unit in UNITS])


def test_quantiles_are_those_of_scipy() -> None:
    assert quantiles(uniform=(2.0, 5.0)) == pytest.approx(uniform(2, 3).ppf(UNITS))
    assert quantiles(log_uniform=(0.1, 10.0)) == pytest.approx(loguniform(0.1, 10).ppf(UNITS))
    normal = truncnorm(-1.5, 0.5, loc=3, scale=2)
    assert quantiles(normal=(3.0, 2.0), clip=(0.0, 4.0)) == pytest.approx(normal.ppf(UNITS))


def test_integers_are_equally_likely_and_reach_both_limits() -> None:
    distribution = ADAPTER.validate_python({"integers": (3, 6)})
    drawn = [distribution.value((i + 0.5) / 400) for i in range(400)]
    assert [drawn.count(value) for value in (3, 4, 5, 6)] == [100] * 4
    assert distribution.value(1.0) == randint(3, 7).support()[1] == 6


@given(low=st.floats(1e-6, 1e6), factor=st.floats(1, 1e6), unit=st.floats(0, 1))
def test_no_value_is_outside_of_the_limits(low: float, factor: float, unit: float) -> None:
    limits = (low, low * factor)
    for node in ({"uniform": limits}, {"log_uniform": limits}):
        assert limits[0] <= ADAPTER.validate_python(node).value(unit) <= limits[1] * (1 + 1e-15)
    normal = {"normal": (low, 0.3 * low), "clip": (0.5 * low, 1.2 * low)}
    assert 0.5 * low <= ADAPTER.validate_python(normal).value(unit) <= 1.2 * low


def test_choices_have_the_probabilities_of_their_weights() -> None:
    node = {"choice": ("a", "b", "c"), "weights": (1.0, 0.0, 3.0)}
    distribution = ADAPTER.validate_python(node)
    drawn = [distribution.value((i + 0.5) / 400) for i in range(400)]
    assert [drawn.count(value) for value in "abc"] == [100, 0, 300]
    assert distribution.value(1.0) == "c"


@pytest.mark.parametrize(
    ("node", "message"),
    [
        ({"uniform": (5.0, 2.0)}, "from low to high"),
        ({"log_uniform": (0.0, 2.0)}, "greater than 0"),
        ({"normal": (1.0, 2.0)}, "clip"),
        ({"normal": (1.0, 0.1), "clip": (3.0, 4.0)}, "within five sigmas"),
        ({"choice": ()}, "at least 1"),
        ({"choice": (1, 2), "weights": (1.0,)}, "one for each choice"),
        ({"choice": (1, 2), "weights": (0.0, 0.0)}, "not all zero"),
        ({"from": "beam.length_mm", "times": "long"}, "a number or a distribution"),
        ({"integers": (1.5, 3)}, "integer"),
        ({"uniform": (float("nan"), 1.0)}, "finite"),
    ],
)
def test_impossible_distributions_are_refused(node: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ADAPTER.validate_python(node)


def test_vectors_are_split_into_their_elements() -> None:
    vector = {"uniform": ((1, 2), (3, 4)), "per": "frame"}
    assert list(elements(vector) or ()) == [
        {"uniform": (1, 3), "per": "frame"},
        {"uniform": (2, 4), "per": "frame"},
    ]
    normal = {"normal": ((1.0, 2.0), 0.5), "clip": (0.0, (2.0, 3.0))}
    assert list(elements(normal) or ()) == [
        {"normal": (1.0, 0.5), "clip": (0.0, 2.0)},
        {"normal": (2.0, 0.5), "clip": (0.0, 3.0)},
    ]
    assert elements({"uniform": (1, 2)}) is None
    assert elements({"choice": ((1, 2), (3, 4))}) is None
