"""Reflected light: Lambert's law under surroundings, a spot and a panel, in both variants."""

import numpy as np
import pytest

from vbaa_bench.geometry import sheets
from vbaa_bench.render.reflection import Reflection
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.lights.ambient import Ambient
from vbaa_bench.scene.lights.emitter import Emitter, Lamp
from vbaa_bench.scene.lights.spot import Spot
from vbaa_bench.scene.paint import PaintedPart

UP = np.array([[0.0, 0.0, 1.0]])
ORIGIN = np.zeros((1, 3))
MATT = PaintedPart(reflectance=0.6)
TILTED = np.array([[0.0, np.sin(0.5), np.cos(0.5)]])


def radiance(light: Emitter, normal: np.ndarray, paint: PaintedPart = MATT) -> float:
    reflection = Reflection([light], np.diag([1e3, 1e3, 1e3, 1.0]))
    return float(reflection.radiance(paint, ORIGIN, normal, UP)[0])


@pytest.fixture(params=["fast", "scalar_rgb"])
def _variant(request: pytest.FixtureRequest, variant: str) -> None:
    activate(variant if request.param == "fast" else "scalar_rgb", 1)


@pytest.mark.usefixtures("_variant")
def test_a_sheet_under_the_sky_has_the_skys_radiance_times_its_reflectance() -> None:
    assert radiance(Ambient(2.0), UP) == pytest.approx(0.6 * 2.0, rel=0.01)
    # A tilted one sees a part of the ground, from which no light comes: (1 + cos) / 2 remains.
    expected = 0.6 * 2.0 * (1 + np.cos(0.5)) / 2
    assert radiance(Ambient(2.0), TILTED) == pytest.approx(expected, rel=0.01)


@pytest.mark.usefixtures("_variant")
def test_a_spot_lights_by_the_cosine() -> None:
    spot = Spot(np.array([0.0, 0.0, 0.5]), np.zeros(3), 0.6, 3.0)
    assert radiance(spot, UP) == pytest.approx(0.6 * 3.0 / np.pi, rel=1e-4)
    assert radiance(spot, TILTED) == pytest.approx(0.6 * 3.0 * np.cos(0.5) / np.pi, rel=1e-4)
    assert radiance(spot, -UP) == 0


@pytest.mark.usefixtures("_variant")
def test_a_panel_has_the_irradiance_of_lamberts_formula() -> None:
    panel = sheets.rectangle(
        np.array([0.1, 0.0, 0.4]), np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), (0.5, 0.3)
    )
    expected = 0.6 * 5.0 * sheets.irradiance(panel, np.zeros(3), TILTED[0]) / np.pi
    assert radiance(Lamp(panel, 5.0), TILTED) == pytest.approx(expected, rel=0.01)
    # Its back is dark.
    panel.invert()
    assert radiance(Lamp(panel, 5.0), UP) == 0
