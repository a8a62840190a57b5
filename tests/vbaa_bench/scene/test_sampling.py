import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from vbaa_bench.scene.sampling import SamplingSpec


def spec(**changed: object) -> SamplingSpec:
    return SamplingSpec.model_validate(
        {
            "method": "sobol",
            "count": 200,
            "contact_distance_mm": (40.0, 200.0),
            "deflection_pct": (2.0, 20.0),
            **changed,
        }
    )


def drawn(made: SamplingSpec, name: str, seed: int = 0) -> np.ndarray:
    return np.array([push[name] for push in made.draw(seed)])


def test_sobol_points_are_even_on_every_axis_and_in_every_pair() -> None:
    made = spec(count=256, normal_deg=(-40.0, 40.0))
    limits = {"contact_distance_mm": (40, 200), "deflection_pct": (2, 20), "normal_deg": (-40, 40)}
    layers = {}
    for name, (low, high) in limits.items():
        fractions = (drawn(made, name) - low) / (high - low)
        assert sorted(np.floor(256 * fractions)) == list(range(256))
        layers[name] = np.floor(16 * fractions)
    for one, other in itertools.combinations(layers.values(), 2):
        counts = np.histogram2d(one, other, bins=16)[0]
        assert counts.max() <= 3  # of independent draws, 7


@pytest.mark.parametrize("method", ["uniform", "log_uniform", "sobol"])
@given(few=st.integers(1, 40), more=st.integers(1, 100), seed=st.integers(0, 2**63 - 1))
@settings(max_examples=10)
def test_a_set_grows(method: str, few: int, more: int, seed: int) -> None:
    small = spec(method=method, count=few).draw(seed)
    large = spec(method=method, count=few + more).draw(seed)
    assert list(large)[:few] == list(small)


@pytest.mark.parametrize("method", ["uniform", "log_uniform", "sobol"])
def test_another_axis_moves_no_other(method: str) -> None:
    one, other = spec(method=method), spec(method=method, stiffness_n_m=(1.0, 100.0))
    for name in ("contact_distance_mm", "deflection_pct"):
        assert (drawn(one, name) == drawn(other, name)).all()


def test_a_latin_hypercube_is_refused_and_sobol_named() -> None:
    with pytest.raises(ValidationError, match="latin_hypercube, allowed is sobol"):
        spec(method="latin_hypercube")


@pytest.mark.parametrize("method", ["uniform", "log_uniform", "sobol"])
def test_draws_fill_their_range_and_depend_on_the_seed_alone(method: str) -> None:
    values = drawn(spec(method=method), "contact_distance_mm")
    assert values.min() >= 40
    assert values.max() <= 200
    assert np.ptp(values) > 150
    assert (values == drawn(spec(method=method), "contact_distance_mm")).all()
    assert (values != drawn(spec(method=method), "contact_distance_mm", seed=1)).any()


def test_log_uniform_draws_are_even_over_decades() -> None:
    made = spec(method="log_uniform", count=4000, contact_distance_mm=(1.0, 100.0))
    values = drawn(made, "contact_distance_mm")
    assert np.mean(values < 10) == pytest.approx(0.5, abs=0.04)


def test_stiffnesses_are_spread_over_decades_in_every_method() -> None:
    values = drawn(spec(count=1000, stiffness_n_m=(1.0, 10_000.0)), "stiffness_n_m")
    assert np.mean(values < 100) == pytest.approx(0.5, abs=0.02)


def test_a_grid_is_even_and_near_the_count() -> None:
    made = spec(method="grid", normal_deg=(-40.0, 40.0))
    pushes = made.draw(0)
    assert len(pushes) == 6**3
    assert len({push["normal_deg"] for push in pushes}) == 6
    steps = np.diff(sorted({push["contact_distance_mm"] for push in pushes}))
    assert steps == pytest.approx(steps[0])


def test_a_point_is_no_axis() -> None:
    made = spec(method="grid", count=9, contact_distance_mm=(120.0, 120.0))
    pushes = made.draw(0)
    assert len(pushes) == 9
    assert {push["contact_distance_mm"] for push in pushes} == {120.0}
    assert "stiffness_n_m" not in pushes[0]


def test_a_range_runs_from_low_to_high() -> None:
    with pytest.raises(ValidationError, match="from low to high"):
        spec(deflection_pct=(20.0, 2.0))
    with pytest.raises(ValidationError, match="allowed is >= 0 with method log_uniform"):
        spec(method="log_uniform", normal_deg=(-10.0, 10.0))
