"""Every light brings what its section says, to where it aims, in whatever unit."""

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from tests.draws import scene_seed
from vbaa_bench.geometry.sheets import axes
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.lights import emitter
from vbaa_bench.render.loading import load
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.lights.ambient import AmbientSpec
from vbaa_bench.scene.lights.environment import Environment, laboratory, plane_irradiance
from vbaa_bench.scene.lights.spot import Spot
from vbaa_bench.scene.schema import Scene

AIM = np.array([0.1206, 0.020, 0.0])
# Where each light comes from, seen from the aim.
FROM: dict[str, tuple[float, float, float]] = {
    "area": (-0.0006, -0.270, 0.420),
    "side": (0.0, -np.cos(np.deg2rad(15)), np.sin(np.deg2rad(15))),
    "ring": (-0.0006, -0.002, 0.360),
    "back": (0.0, 0.0, -1.0),
    "stripe": (-0.0006, -0.220, 0.350),
    "spot": (-0.1206, -0.220, 0.350),
    "environment": (0.0, 0.0, 1.0),
}


@pytest.fixture(scope="module", autouse=True)
def _renderer(variant: str) -> None:
    activate(variant, 2)


def scene_under(*lamps: dict[str, Any], scale: float = 1.0) -> Scene:
    """The reference rig under lamps, all lengths scaled."""

    def scaled(key: str, value: Any) -> Any:
        if not key.endswith("_mm"):
            return value
        return tuple(v * scale for v in value) if isinstance(value, tuple) else value * scale

    lamps = tuple({key: scaled(key, value) for key, value in lamp.items()} for lamp in lamps)
    camera = {"position_mm": (120.0, 18.0, 360.0), "look_at_mm": (120.6, 20.0, 0.0)}
    return Scene.model_validate(
        {
            "title": "lights",
            "seed": 1,
            "pushes": {"contact_distance_mm": (100.0,), "deflection_pct": (10.0,)},
            "camera": {key: scaled(key, value) for key, value in camera.items()},
            "background": {"distance_mm": 30.0 * scale},
            "lights": lamps,
        }
    )


def measured(scene: Scene, at: Floats, facing: Floats, unit: float = 0.4e-3) -> float:
    """Irradiance of a small sheet at `at` (3,) [m], as a renderer's picture of it tells."""
    matrix = np.diag([1 / unit, 1 / unit, 1 / unit, 1.0])
    matrix[:3, 3] = -AIM / 0.4e-3
    place = matrix[:3, :3] @ at + matrix[:3, 3]
    first, second, ahead = axes(facing, np.array([1.0, 0.0, 0.0]))
    pose = np.eye(4)
    pose[:3] = np.column_stack([first, second, ahead, place])
    eye = place + 20 * ahead + 5 * first
    looking = mi.ScalarTransform4f().look_at(
        origin=eye.tolist(), target=place.tolist(), up=second.tolist()
    )
    film = {"type": "hdrfilm", "width": 2, "height": 2, "pixel_format": "luminance"}
    sheet = {"type": "rectangle", "to_world": mi.ScalarTransform4f(pose.tolist())}
    sheet["bsdf"] = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}
    described = {"type": "scene", "sheet": sheet, "integrator": {"type": "direct"}}
    described["sensor"] = {"type": "perspective", "fov": 1.0, "to_world": looking, "film": film}
    for number, light in enumerate(lights(scene, Path())):
        described[f"light_{number}"] = emitter(light, matrix)
    image = mi.render(load(described), spp=16384, seed=mi.UInt32(scene_seed(1)))
    return float(np.mean(np.asarray(image)) * np.pi / 0.5)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", FROM)
def test_a_sheet_at_the_aim_gets_the_stated_irradiance(kind: str) -> None:
    scene = scene_under({"kind": kind, "irradiance": 3.0})
    got = measured(scene, AIM, np.array(FROM[kind]))
    assert got == pytest.approx(3.0, rel=0.02)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", [None, "side", "environment"])
def test_ambient_light_adds_its_irradiance(kind: str | None) -> None:
    lamps: tuple[dict[str, Any], ...] = () if kind is None else ({"kind": kind, "irradiance": 2.0},)
    alone = scene_under(*lamps)
    scene = alone.model_copy(update={"ambient": AmbientSpec(irradiance=0.5)})
    up, place = np.array([0.0, 0.0, 1.0]), AIM * [1, 1, 0]
    lamp, both = measured(alone, place, up), measured(scene, place, up)
    # Relative to the soft lamp, or in the unit of the irradiances of lamps.
    expected = 1.5 * lamp if kind is None else lamp + 0.5
    assert both == pytest.approx(expected, rel=0.02)
    # It reaches the underside as well, where no lamp hides a part of it.
    below = measured(scene, place, -up) - measured(alone, place, -up)
    # Each of the four is known to some thousandths, of which the sum is 2 % of it.
    assert below >= 0.85 * (both - lamp)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", FROM)
def test_a_rig_ten_thousand_times_smaller_is_lit_the_same(kind: str) -> None:
    # Beside the aim, where distances count.
    facing, beside = np.array(FROM[kind]), AIM + np.array([0.02, 0.01, 0.0])
    whole = measured(scene_under({"kind": kind, **SIZES[kind]}), beside, facing)
    small = scene_under({"kind": kind, **SIZES[kind]}, scale=1e-4)
    matrix_origin = 1e-4 * beside
    assert measured(small, matrix_origin, facing, unit=0.4e-7) == pytest.approx(whole, rel=1e-3)
    assert 0.5 < whole < 1.2


# What a lamp's defaults are in millimetres, so that they can be scaled.
SIZES: dict[str, dict[str, Any]] = {
    "area": {"position_mm": (120.0, -250.0, 420.0), "size_mm": (300.0, 200.0)},
    "side": {"distance_mm": 400.0, "size_mm": (400.0, 100.0)},
    "ring": {"inner_radius_mm": 35.0, "outer_radius_mm": 60.0},
    "back": {"size_mm": (400.0, 400.0), "height_above_background_mm": 0.5},
    "stripe": {
        "position_mm": (120.0, -200.0, 350.0),
        "length_mm": 280.0,
        "width_mm": 90.0,
        "edge_width_mm": 4.0,
    },
    "spot": {"position_mm": (0.0, -200.0, 350.0)},
    "environment": {},
}


def test_two_lights_add_up() -> None:
    scene = scene_under({"kind": "ring"}, {"kind": "spot", "position_mm": (120.0, 18.0, 800.0)})
    assert measured(scene, AIM, np.array([0.0, 0.0, 1.0])) == pytest.approx(2.0, rel=0.01)


def test_a_panel_behind_the_beam_is_off_while_a_board_is_seen() -> None:
    both = scene_under({"kind": "back"}, {"kind": "spot"})
    assert [type(light) for light in lights(both, Path(), panels=False)] == [Spot]
    (soft,) = lights(scene_under({"kind": "back"}), Path(), panels=False)
    assert soft.sheet is not None
    assert soft.sheet.radiance == 1


def test_a_stripe_is_as_long_and_wide_as_it_says() -> None:
    scene = scene_under(
        {"kind": "stripe", "length_mm": 200.0, "width_mm": 60.0, "edge_width_mm": 4.0}
    )
    along, across, ahead = axes(np.array(FROM["stripe"]), np.array([1.0, 0.0, 0.0]))
    for way, half in ((along, 0.1), (across, 0.03)):
        for side in (-1, 1):
            inside, rim, outside = (
                measured(scene, AIM + side * (half + off) * way, ahead) for off in (-5e-3, 0, 5e-3)
            )
            assert inside == pytest.approx(1.0, rel=0.01)
            assert rim == pytest.approx(0.5, abs=0.05)
            assert outside == 0.0


def test_a_map_of_the_surroundings_is_the_right_way_round(monkeypatch: pytest.MonkeyPatch) -> None:
    # One patch of light, at azimuth 60 degrees and 30 degrees above the horizon.
    image = np.zeros((180, 360))
    image[58:62, 58:62] = 1000.0
    polar, azimuth = np.deg2rad(60), np.deg2rad(60)
    way = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), 0.5])
    solid_angle = np.deg2rad(4) * (np.cos(np.deg2rad(58)) - np.cos(np.deg2rad(62)))
    module = "vbaa_bench.render.illumination"
    monkeypatch.setattr(f"{module}.lights", lambda *_: None)
    monkeypatch.setitem(globals(), "lights", lambda *_: [Environment(image)])
    scene = scene_under({"kind": "environment"})
    assert measured(scene, AIM, way) == pytest.approx(1000 * solid_angle, rel=0.02)
    lower = np.array([way[0], way[1], -way[2]])
    expected = 1000 * solid_angle * (way @ lower)
    assert measured(scene, AIM, lower) == pytest.approx(expected, rel=0.03)
    assert measured(scene, AIM, np.array([-way[0], -way[1], 0.0])) == 0


def test_a_picture_is_looked_for_beside_the_scene(tmp_path: Path) -> None:
    scene = scene_under({"kind": "environment", "file": "sky.exr"})
    with pytest.raises(InputError, match=f"{tmp_path}/sky.exr: "):
        lights(scene, tmp_path)


def test_the_laboratory_is_bright_at_its_window() -> None:
    image = laboratory()
    assert plane_irradiance(image) > 0
    brightest = np.unravel_index(image.argmax(), image.shape)
    assert image.max() > 30 * np.median(image)
    assert brightest[0] < image.shape[0] / 2
