import re
from typing import Any

import pytest
from pydantic import ValidationError

from vbaa_bench.scene.image_sensor import SensorSpec


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"bits": 9}, "8, 10, 12, 14 or 16"),
        ({"quantum_efficiency": 0.0}, "greater than 0"),
        ({"quantum_efficiency": 1.1}, "less than or equal to 1"),
        ({"gamma": 0.5}, "greater than or equal to 1"),
        ({"exposure_s": 0.0}, "greater than 0"),
        (
            {"kind": "ideal", "read_noise_e": 5.0, "gamma": 2.2},
            "kind is ideal and read_noise_e, gamma given, allowed with it are bits, "
            "beam_peak_pct, rest_images, ground_images, exposure_s, line_time_us",
        ),
        (
            {"gain_e_per_gray": 100.0},
            "beam_peak_pct is 70, with this gain 17850 electrons, allowed is at most the full well "
            "of 10000",
        ),
        (
            {"black_level_gray": 200.0},
            "black_level_gray is 200, allowed is below 178.5, the beam's gray value before gamma",
        ),
        (
            {"dark_current_e_s": 8e3, "exposure_s": 1.0},
            "dark_current_e_s times exposure_s is 8000 electrons, allowed is below the 7000 at "
            "which the beam peaks",
        ),
        (
            {"jpeg_quality": 90, "bits": 12},
            "jpeg_quality is 90 and bits is 12, allowed with jpeg_quality is 8: JPEG images have "
            "8 bits",
        ),
        ({"jpeg_quality": 0}, "greater than or equal to 1"),
        ({"hot_pixels_ppm": 2e5}, "less than or equal to 100000"),
        ({"bayer": {"red": 0.0}}, "greater than or equal to 0.01"),
        ({"bayer": {"pattern": "rgbg"}}, "'rggb', 'bggr', 'grbg' or 'gbrg'"),
        ({"read_noise_e": 2e4}, "read_noise_e is 20000, allowed is below the full well of 10000"),
        ({"dsnu_e": 2e4}, "dsnu_e is 20000, allowed is below the full well of 10000"),
    ],
)
def test_what_contradicts_itself_is_said_in_a_sentence(values: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=re.escape(said)):
        SensorSpec.model_validate(values)


def test_defaults_may_be_written_out_for_an_ideal_one() -> None:
    spec = SensorSpec(kind="ideal", bits=12)
    assert SensorSpec.model_validate(spec.model_dump()) == spec


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_the_full_well_is_full_scale_unless_a_gain_is_given(bits: int) -> None:
    spec = SensorSpec.model_validate({"bits": bits, "beam_peak_pct": 100})
    assert spec.gain * spec.full_scale == pytest.approx(spec.full_well_e)
    assert spec.peak_signal == pytest.approx(spec.full_well_e)
    assert SensorSpec(beam_peak_pct=40, gain_e_per_gray=50.0).peak_signal == pytest.approx(5100)
