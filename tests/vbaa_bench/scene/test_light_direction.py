"""The light's slope along the beam, from where the lamps stand."""

import math
from typing import Any

import pytest

from vbaa_bench.scene.light_direction import LightSlope, light_slope
from vbaa_bench.scene.load import check_scene

CAMERA = {"position_mm": [120.0, 20.0, 360.0], "look_at_mm": [120.0, 20.0, 0.0]}
PUSHES = {"contact_distance_mm": [120], "deflection_pct": [5]}
SMALL = {"size_mm": [10, 10]}


def slope(*lights: dict[str, Any]) -> LightSlope:
    document = {
        "title": "Lamps",
        "seed": 1,
        "pushes": PUSHES,
        "beam": {"length_mm": 240},
        "camera": CAMERA,
        "lights": list(lights),
    }
    return light_slope(check_scene(document).scene)


def test_a_ring_and_a_panel_behind_the_beam_have_none() -> None:
    assert slope({"kind": "ring"}) == (0.0, 0.0)
    assert slope({"kind": "back"}) == (0.0, 0.0)


@pytest.mark.parametrize("azimuth", [0.0, 60.0, 180.0])
def test_a_far_lamp_at_the_side_has_the_cotangent_of_its_elevation(azimuth: float) -> None:
    """The camera sees the beam's ends at a third to either side."""
    lamp = {"kind": "side", "azimuth_deg": azimuth, "elevation_deg": 40, "distance_mm": 1e6}
    found = slope(lamp)
    expected = math.cos(math.radians(azimuth)) / math.tan(math.radians(40))
    assert found.mean == pytest.approx(expected, abs=1e-3)
    assert found.sigma == pytest.approx(math.sqrt(2 / 3) / 3, rel=1e-3)


def test_a_lamp_at_the_camera_has_none() -> None:
    found = slope({"kind": "area", "position_mm": CAMERA["position_mm"], **SMALL})
    assert found == pytest.approx((0.0, 0.0), abs=1e-12)


def test_lamps_count_by_their_irradiance() -> None:
    left = {"kind": "side", "azimuth_deg": 180, "elevation_deg": 45, "distance_mm": 1e6}
    right = {**left, "azimuth_deg": 0, "irradiance": 3.0}
    found = slope(left, right)
    assert found.mean == pytest.approx((3 - 1) / 4, abs=1e-3)
    assert found.sigma == pytest.approx(math.sqrt(1 - 0.25 + 2 / 27), rel=1e-3)


def test_light_from_all_around_may_come_from_anywhere() -> None:
    found = slope({"kind": "environment"})
    assert found.mean == 0.0
    assert found.sigma > 0.3
