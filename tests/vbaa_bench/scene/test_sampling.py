import numpy as np
import pytest
from pydantic import ValidationError

from vbaa_bench.scene.sampling import SamplingSpec


def spec(**changed: object) -> SamplingSpec:
    return SamplingSpec.model_validate(
        {
            "method": "latin_hypercube",
            "count": 200,
            "contact_distance_mm": (40.0, 200.0),
            "deflection_pct": (2.0, 20.0),
            **changed,
        }
    )


def drawn(made: SamplingSpec, name: str, seed: int = 0) -> np.ndarray:
    return np.array([push[name] for push in made.draw(np.random.default_rng(seed))])


def test_a_latin_hypercube_has_one_push_in_every_layer_of_every_axis() -> None:
    for name, (low, high) in (("contact_distance_mm", (40, 200)), ("deflection_pct", (2, 20))):
        values = drawn(spec(), name)
        layers = np.floor((values - low) / (high - low) * 200).astype(int)
        assert sorted(layers) == list(range(200))


@pytest.mark.parametrize("method", ["uniform", "log_uniform", "latin_hypercube"])
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
    pushes = made.draw(np.random.default_rng(0))
    assert len(pushes) == 6**3
    assert len({push["normal_deg"] for push in pushes}) == 6
    steps = np.diff(sorted({push["contact_distance_mm"] for push in pushes}))
    assert steps == pytest.approx(steps[0])


def test_a_point_is_no_axis() -> None:
    made = spec(method="grid", count=9, contact_distance_mm=(120.0, 120.0))
    pushes = made.draw(np.random.default_rng(0))
    assert len(pushes) == 9
    assert {push["contact_distance_mm"] for push in pushes} == {120.0}
    assert "stiffness_n_m" not in pushes[0]


def test_a_range_runs_from_low_to_high() -> None:
    with pytest.raises(ValidationError, match="from low to high"):
        spec(deflection_pct=(20.0, 2.0))
    with pytest.raises(ValidationError, match="allowed is >= 0 with method log_uniform"):
        spec(method="log_uniform", normal_deg=(-10.0, 10.0))
