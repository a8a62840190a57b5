"""Pixels outside the affected ones are equal to those of the static layer."""

from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at
from tests.draws import scene_seed
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.render.affected_pixels import View, shadows
from vbaa_bench.render.frame import NoiseTarget, StaticLayer, render_frame, render_static_layer
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.lights.emitter import Emitter, Lamp
from vbaa_bench.scene.lights.environment import Environment
from vbaa_bench.scene.lights.spot import Spot
from vbaa_bench.scene.objects.block import block

MIDDLE = np.array([0.12, 0.0, 0.0])
CAMERA = Camera(
    96,
    80,
    150.0,
    150.0,
    47.5,
    39.5,
    camera_looking_at(MIDDLE + np.array([0.02, 0.0, 0.3]), MIDDLE, 0.2),
)
DISTORTED = replace(CAMERA, distortion=(-0.3, 0.1, 0.002, 0.001, 0.0))
LAMP = Lamp(sheet(np.array([0.05, 0.0, 0.5]), 0.1, -1))
LOW_LAMP = Lamp(sheet(np.array([0.3, 0.2, 0.02]), 0.05, -1))
SPOT = Spot(np.array([0.0, 0.2, 0.4]), MIDDLE, 1.5, 1.0)


@pytest.fixture(scope="module", autouse=True)
def _renderer(variant: str) -> None:
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts every pixel is traced")


def make_world(camera: Camera, light: Emitter) -> World:
    thing = block(0.02, -0.03, 0.03)
    thing.apply_translation(MIDDLE)
    surfaces = {
        "object": Surface(thing, 0.5),
        "background": Surface(sheet(MIDDLE - [0, 0, 0.03], 3.0, 1), 0.3),
    }
    return World(camera, light, surfaces, RenderUnit(1e-3, MIDDLE), still={"background"})


@pytest.mark.parametrize("camera", [CAMERA, DISTORTED], ids=["ideal", "distorted"])
@pytest.mark.parametrize("light", [LAMP, LOW_LAMP, SPOT], ids=["above", "low", "spot"])
def test_nothing_changes_out_of_reach(camera: Camera, light: Emitter) -> None:
    world = make_world(camera, light)
    target = NoiseTarget(lambda radiance: 0.2 * radiance + 1e-3)
    still = render_static_layer(world, target, scene_seed(1))
    seen = render_frame(world, still, target, scene_seed(2))
    apart = ~seen.affected
    rows, columns = np.nonzero(np.ones_like(apart))
    pixels = np.column_stack([columns, rows])
    found = trace(world, pixels, np.full(len(pixels), 64), scene_seed(3), "change")
    change = found.radiance.reshape(apart.shape)
    assert (change[apart] == 0).all()
    assert (change != 0).sum() > 200
    if light is not LOW_LAMP:  # whose shadows may fall anywhere
        assert apart.mean() > 0.1


def test_shadows_of_a_box_are_its_projections() -> None:
    box = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    light = Spot(np.array([0.0, 0.0, 3.0]), np.zeros(3), 1.0, 1.0)
    (hull,) = shadows([box], [light], ground=-1.0) or []
    # From three above the top's corner (1, 1, 1) is thrown to twice its distance from the axis.
    assert hull.max(axis=0) == pytest.approx([2.0, 2.0, -1.0])
    assert hull.min(axis=0) == pytest.approx([0.0, 0.0, -1.0])


def test_light_from_all_around_shades_anywhere() -> None:
    box = [np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])]
    assert shadows(box, [Environment(np.ones((4, 8)))], -1.0) is None
    assert shadows(box, [Spot(np.array([5.0, 0.0, 0.5]), np.zeros(3), 1.0, 1.0)], -1.0) is None
    below = Spot(np.array([0.0, 0.0, -2.0]), np.zeros(3), 1.0, 1.0)
    assert shadows(box, [below], -1.0) == []


def test_a_body_behind_the_camera_may_show_anywhere() -> None:
    view = View(CAMERA)
    assert view.hulls([MIDDLE + np.array([[0, 0, 0.6], [0, 0.01, 0.6], [0.01, 0, 0.6]])], 0).all()
    assert not view.hulls([], 3).any()


def test_a_plate_alone_is_the_still_scene() -> None:
    world = make_world(CAMERA, LAMP)
    made: StaticLayer = render_static_layer(
        world, NoiseTarget(lambda radiance: 0.1 * radiance + 1e-3), scene_seed(1)
    )
    assert set(np.unique(made.layers.object_index)) == {2}
    away = np.asarray(block(0.02, -0.03, 0.03).vertices) + MIDDLE + [0.0, 5.0, 0.0]
    world.move({"object": away})
    seen = render_frame(
        world, made, NoiseTarget(lambda radiance: 0.1 * radiance + 1e-3), scene_seed(2)
    )
    assert seen.radiance == pytest.approx(made.radiance)
