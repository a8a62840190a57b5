import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.instrument.errors import InputError
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.sensor.from_spec import (
    fixed_pattern,
    image_sensor,
    metered_exposure,
    unsaturated_exposure,
)
from vbaa_bench.sensor.ideal import Ideal

SPECS = [
    SensorSpec(),
    SensorSpec(bits=16, beam_peak_pct=90),
    SensorSpec(bits=12, gain_e_per_gray=2.0, black_level_gray=200.0, quantum_efficiency=0.4),
    SensorSpec(gamma=2.2, beam_peak_pct=60),
    SensorSpec(bits=10, gamma=1.8, black_level_gray=16.0, dark_current_e_s=2e4, exposure_s=0.05),
    SensorSpec(kind="ideal", bits=14),
]


@pytest.mark.parametrize("spec", SPECS)
def test_the_beam_peaks_at_its_share_of_full_scale(
    spec: SensorSpec, random: np.random.Generator
) -> None:
    sensor = image_sensor(spec, metered_exposure(spec, 0.35))
    frame = sensor.expose(np.full((300, 300), 0.35), random)
    rounding = 50 / spec.full_scale
    peak = frame.mean() / spec.full_scale * 100
    assert peak == pytest.approx(spec.beam_peak_pct, abs=0.02 + rounding)


@pytest.mark.parametrize("kind", ["real", "ideal"])
def test_a_black_beam_cannot_be_exposed_for(kind: str) -> None:
    with pytest.raises(InputError, match="no light reaches the beam"):
        metered_exposure(SensorSpec.model_validate({"kind": kind}), 0.0)


def test_a_fixed_pattern_is_drawn_where_one_is_asked_for(random: np.random.Generator) -> None:
    assert fixed_pattern(SensorSpec(), (8, 9), random) is None
    pattern = fixed_pattern(SensorSpec(prnu_pct=1.0), (300, 200), random)
    assert pattern is not None
    assert pattern.response.shape == (300, 200)
    assert np.std(pattern.response) == pytest.approx(0.01, rel=0.02)
    assert not pattern.offset.any()
    assert image_sensor(SensorSpec(prnu_pct=1.0), 1.0, pattern).pattern is pattern  # type: ignore[union-attr]


def test_an_ideal_sensor_is_asked_for_by_its_kind() -> None:
    assert image_sensor(SensorSpec(kind="ideal", bits=12), 2.0) == Ideal(2.0, 12)


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@given(
    peak_pct=st.floats(1, 100),
    black=st.floats(0, 2),
    brightness=st.floats(0.01, 100),
    kind=st.sampled_from(["real", "ideal"]),
)
def test_an_image_is_exposed_less_only_if_it_would_be_saturated(
    peak_pct: float, black: float, brightness: float, kind: str
) -> None:
    changed = {"black_level_gray": black} if kind == "real" else {}
    spec = SensorSpec.model_validate({"kind": kind, "beam_peak_pct": peak_pct, **changed})
    exposure = metered_exposure(spec, 1.0)
    chosen = unsaturated_exposure(spec, exposure, brightness)

    def gray(radiance: float, at_exposure: float) -> float:
        if kind == "ideal":
            return at_exposure * radiance * spec.full_scale
        electrons = spec.quantum_efficiency * at_exposure * radiance
        return electrons / spec.gain + spec.black_level_gray

    assert gray(brightness, chosen) <= spec.full_scale * (1 + 1e-9)
    if gray(brightness, exposure) < spec.full_scale * (1 - 1e-9):
        assert chosen == exposure
    elif gray(brightness, exposure) > spec.full_scale * (1 + 1e-9):
        assert chosen == metered_exposure(spec, brightness)
