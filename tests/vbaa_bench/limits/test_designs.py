"""Designs and requirements as they are typed, and what mistakes get."""

from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from vbaa_bench.limits.designs import designs
from vbaa_bench.limits.places import grid
from vbaa_bench.limits.requirements import requirements

QUICKSTART = Path("scenes/quickstart.yaml")


def settings(*vary: str) -> list[tuple[str, ...]]:
    return [design.settings for design in designs(QUICKSTART, vary, "image")]


def test_variations_are_combined() -> None:
    assert settings("beam.diameter_mm=0.4,0.8", "sensor.bits=8,12") == [
        ("beam.diameter_mm=0.4", "sensor.bits=8"),
        ("beam.diameter_mm=0.4", "sensor.bits=12"),
        ("beam.diameter_mm=0.8", "sensor.bits=8"),
        ("beam.diameter_mm=0.8", "sensor.bits=12"),
    ]
    assert settings() == [()]


def test_keys_change_together_with_one_value_or_several() -> None:
    assert settings("sensor.full_well_e+sensor.read_noise_e=10000+10,50") == [
        ("sensor.full_well_e=10000", "sensor.read_noise_e=10"),
        ("sensor.full_well_e=50", "sensor.read_noise_e=50"),
    ]


def test_lists_are_values() -> None:
    vary = "camera.position_mm=[120, 22, 360],[120,0,360]"
    assert [design.name for design in designs(QUICKSTART, [vary], "image")] == [
        "position_mm [120, 22, 360]",
        "position_mm [120,0,360]",
    ]


def test_names_of_designs_are_as_long_as_needed() -> None:
    (design,) = designs(QUICKSTART, ["hub.radius_mm=4", "beam.reflectance=0.8"], "image")
    assert design.name == "radius_mm 4, reflectance 0.8"
    alike = ["background.reflectance=0.1", "beam.reflectance=0.8"]
    (design,) = designs(QUICKSTART, alike, "image")
    assert design.name == "background.reflectance 0.1, beam.reflectance 0.8"
    # Of keys that change together, the first that distinguishes the designs.
    together = "sensor.full_well_e+sensor.read_noise_e+beam.diameter_mm"
    names = [
        one.name for one in designs(QUICKSTART, [f"{together}=1000+1+0.4,1000+2+0.8"], "image")
    ]
    assert names == ["read_noise_e 1", "read_noise_e 2"]
    three = f"{together}=1000+1+0.4,1000+2+0.8,2000+2+0.4"
    assert designs(QUICKSTART, [three], "image")[1].name == (
        "full_well_e 1000, read_noise_e 2, diameter_mm 0.8"
    )


def test_an_impossible_design_keeps_its_reason_and_the_others_remain() -> None:
    good, bad, wrong = designs(QUICKSTART, ["camera.focal_length_px=700,3000,x"], "image")
    assert good.file is not None
    assert (bad.file, wrong.file) == (None, None)
    assert "does not see the whole board" in bad.reason
    assert "camera.focal_length_px is 'x'" in wrong.reason


def test_without_a_possible_design_all_reasons_are_listed() -> None:
    with pytest.raises(InputError, match=r"focal_length_px is 'x'(.|\n)*focal_length_px is 'y'"):
        designs(QUICKSTART, ["camera.focal_length_px=x,y"], "image")
    with pytest.raises(InputError, match=r"object\.kind is wall, which has no contact distance"):
        designs(Path("scenes/fig5_line_contact.yaml"), (), "image")
    with pytest.raises(InputError, match="mechanics is linear, but the limits are those"):
        designs(Path("scenes/linear_beam.yaml"), (), "image")
    with pytest.raises(InputError, match="moment_sensor is missing"):
        designs(QUICKSTART, (), "moment")
    with pytest.raises(InputError, match="--information is learned, which needs the pushes"):
        designs(QUICKSTART, (), "learned")


@pytest.mark.parametrize(
    ("vary", "reason"),
    [
        ("beam.diameter_mm", "allowed is KEY=VALUE"),
        ("beam.diameter_mm=0.4,", "allowed is KEY=VALUE"),
        ("sensor.bits+=8", "allowed is KEY=VALUE"),
        ("a.b+a.c=1+2+3", "has 3 values, allowed are 1 and 2"),
    ],
)
def test_mistakes_in_variations_are_one_sentence(vary: str, reason: str) -> None:
    with pytest.raises(InputError, match=f"--vary is .*{reason}"):
        designs(QUICKSTART, [vary], "image")


def test_requirements_name_quantity_and_unit() -> None:
    first, second = requirements(["x_c_pct_L=0.1,force_mn=1"], "image")
    assert (str(first), str(second)) == ("x_c ≤ 0.1 % of L", "force ≤ 1 mN")
    assert first.accuracy.column == "x_c_limit_pct_L"


@pytest.mark.parametrize(
    ("text", "information", "reason"),
    [
        ("x_c=1", "image", "a name of x_c_pct_L"),
        ("x_c_mm=0", "image", "a number above 0"),
        ("x_c_mm=wide", "image", "a number above 0"),
        ("psi_deg=1", "planar", "planar has no such limit"),
        ("compliance_mm_per_n=1", "image", "image has no such limit"),
    ],
)
def test_mistakes_in_requirements_are_one_sentence(
    text: str, information: str, reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        requirements([text], information)


def test_places_are_sorted_and_possible() -> None:
    assert grid([50, 20, 50], [5]) == ((20, 50), (5,))
    with pytest.raises(InputError, match="--contact-distance-pct is 100, allowed is above 0"):
        grid([50, 100], [5])
    with pytest.raises(InputError, match="--deflection-pct is 0, allowed is above 0 and below 60"):
        grid([50], [0])
