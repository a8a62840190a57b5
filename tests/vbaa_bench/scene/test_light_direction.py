"""The light's direction along the beam, from where the lamps stand."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.rig import LIGHT_DISTANCES_MM, MAX_LIGHT_SLOPE
from vbaa_bench.geometry.sheets import irradiance
from vbaa_bench.render.illumination import lights
from vbaa_bench.scene.light_direction import (
    LightDirection,
    light_across,
    light_direction,
)
from vbaa_bench.scene.lights.ambient import EVEN
from vbaa_bench.scene.lights.emitter import Lamp
from vbaa_bench.scene.lights.environment import ENVIRONMENT_SIGMA
from vbaa_bench.scene.lights.sight import PLACE_SIGMA
from vbaa_bench.scene.load import check_scene
from vbaa_bench.scene.schema import Scene

CAMERA = {"position_mm": [120.0, 20.0, 360.0], "look_at_mm": [120.0, 20.0, 0.0]}
PUSHES = {"contact_distance_mm": [120], "deflection_pct": [5]}
SMALL = {"size_mm": [10, 10]}


def scene(*lights: dict[str, Any], **sections: Any) -> Scene:
    document = {
        "title": "Lamps",
        "seed": 1,
        "pushes": PUSHES,
        "beam": {"length_mm": 240},
        "camera": CAMERA,
        "lights": list(lights),
    }
    return check_scene(document | sections).scene


def direction(*lights: dict[str, Any], **sections: Any) -> LightDirection:
    return light_direction(scene(*lights, **sections))


def test_a_ring_and_a_panel_behind_the_beam_change_as_the_camera() -> None:
    assert direction({"kind": "ring"}) == pytest.approx((0.0, 0.0, 360.0))
    assert direction({"kind": "back"}) == pytest.approx((0.0, 0.0, 360.0))


@pytest.mark.parametrize("azimuth", [0.0, 60.0, 180.0])
def test_a_far_lamp_at_the_side_has_the_cotangent_of_its_elevation(azimuth: float) -> None:
    lamp = {"kind": "side", "azimuth_deg": azimuth, "elevation_deg": 40, "distance_mm": 1e6}
    light = direction(lamp)
    expected = math.cos(math.radians(azimuth)) / math.tan(math.radians(40))
    assert light.slope == pytest.approx(expected, abs=1e-3)
    # The camera is 20 mm beside the beam.
    across = math.sin(math.radians(azimuth)) / math.tan(math.radians(40)) - 20 / 360
    assert light_across(scene(lamp)) == pytest.approx(math.hypot(across, PLACE_SIGMA), abs=1e-3)
    assert light.sigma == PLACE_SIGMA
    assert light.distance_mm == pytest.approx(1e6 * math.sin(math.radians(40)), rel=1e-3)


def test_a_small_lamp_at_the_camera_has_no_slope_and_the_cameras_distance() -> None:
    light = direction({"kind": "area", "position_mm": CAMERA["position_mm"], **SMALL})
    assert light == pytest.approx((0.0, PLACE_SIGMA, 360.0), rel=1e-3, abs=1e-12)


def test_a_wide_lamp_is_as_one_farther_away() -> None:
    """Lambert's formula gives the irradiance of planes that face the lamp more or less."""
    wide = scene(light={"side_mm": 700, "height_mm": 420})
    lamp = lights(wide, Path())[0]
    assert isinstance(lamp, Lamp)
    places = np.array([[x, 0.02, 0.0] for x in (0.06, 0.18)])
    tangents = [
        irradiance(lamp.mesh, place, np.array([1.0, 0.0, 0.0]))
        / irradiance(lamp.mesh, place, np.array([0.0, 0.0, 1.0]))
        for place in places
    ]
    distance_mm = 120 / (tangents[0] - tangents[1])
    assert light_direction(wide).distance_mm == pytest.approx(distance_mm, rel=0.02)


def test_lamps_count_by_their_irradiance() -> None:
    left = {"kind": "side", "azimuth_deg": 180, "elevation_deg": 45, "distance_mm": 1e6}
    right = {**left, "azimuth_deg": 0, "irradiance": 3.0}
    light = direction(left, right)
    assert light.slope == pytest.approx((3 - 1) / 4, abs=1e-3)
    assert light.sigma == pytest.approx(math.sqrt(1 - 0.25 + PLACE_SIGMA**2), rel=1e-3)


def test_even_light_from_above_makes_a_lamp_less_oblique() -> None:
    lamp = {"kind": "side", "azimuth_deg": 0, "elevation_deg": 45, "distance_mm": 1e6}
    light = direction(lamp, ambient={"irradiance": 1.0})
    assert light.slope == pytest.approx(0.5, abs=1e-3)
    # Half of the light changes as that of a far lamp, half as even light does.
    assert light.distance_mm == pytest.approx(2 * 360 / (1 - EVEN), rel=1e-2)


def test_even_light_shifts_the_shading_less() -> None:
    """The mean of x over a matt cylinder's section, seen from a milliradian to its side."""
    angle = (np.arange(200_000) + 0.5) / 200_000 * np.pi - np.pi / 2
    x, dx = np.sin(angle), np.cos(angle)

    def shift(brightness: Floats) -> float:
        return float((brightness * dx) @ x / (brightness @ dx))

    turned = angle - 1e-3
    even, beam = (1 + np.cos(turned)) / 2, np.cos(turned)
    assert shift(even) / shift(beam) == pytest.approx(EVEN, rel=1e-3)


@pytest.mark.parametrize("height", [1e-300, 0.0, -100.0])
def test_light_that_grazes_plane_c_has_the_largest_slope_of_a_rig_file(height: float) -> None:
    light = direction({"kind": "spot", "position_mm": [500.0, 0.0, height]})
    assert light.slope == MAX_LIGHT_SLOPE
    assert 0 < light.sigma <= MAX_LIGHT_SLOPE
    assert LIGHT_DISTANCES_MM[0] <= light.distance_mm <= LIGHT_DISTANCES_MM[1]


def test_light_from_all_around_may_come_from_anywhere() -> None:
    light = direction({"kind": "environment"})
    assert light == pytest.approx((0.0, ENVIRONMENT_SIGMA, 360 / (1 - EVEN)))
