"""Light that surfaces reflect to each other: as much as in plain Mitsuba, with less noise."""

import numpy as np
import pytest

from results.render_speed.plain import Plain
from solver.instrument.arrays import Floats
from tests.draws import scene_seed
from tests.vbaa_bench.render.test_hidden_strip import bent
from tests.vbaa_bench.render.test_thin_beams import CAMERA, MIDDLE
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.geometry.tube import arc_length_of_vertices, tube
from vbaa_bench.render.frame import NoiseTarget, render_frame, render_static_layer
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.lights.emitter import Lamp

BOUNCES = 3
PIXELS = np.argwhere(np.ones((CAMERA.height, CAMERA.width)))[:, ::-1]


@pytest.fixture(scope="module")
def world(variant: str) -> World:
    """A bent beam over bright ground, and a wall of bare steel beside it."""
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts whole images are rendered")
    skin = tube(bent(0.0), 6e-4, 24, caps_apart=True)
    s = arc_length_of_vertices(np.linspace(0, 0.024, 60), 24)
    wall = sheet(np.zeros(3), 0.02, 1)
    wall.vertices = MIDDLE + np.asarray(wall.vertices)[:, [0, 2, 1]] + [0, 0.006, 0]
    surfaces = {
        "beam": Surface(skin, 0.85, "gloss", arc_length=s, smooth=True),
        "object": Surface(wall, 0.5, "bare"),
        "background": Surface(sheet(MIDDLE - [0, 0, 0.006], 2.0, 1), 0.8),
    }
    lamp = Lamp(sheet(np.array([0.12, -0.05, 0.42]), 0.4, -1))
    unit = RenderUnit(6e-4, MIDDLE)
    return World(CAMERA, lamp, surfaces, unit, still={"background"}, bounces=BOUNCES)


@pytest.fixture(scope="module")
def plain(world: World) -> Floats:
    """Images (n, height, width) of plain Mitsuba."""
    renderer = Plain(world, "independent")
    return np.array([renderer.radiance(512, scene_seed(seed)) for seed in range(8)])


def bands(image: Floats) -> Floats:
    """Means of bands of rows, of which some show the beam and the wall."""
    return np.asarray(image.reshape(*image.shape[:-2], 10, -1).mean(axis=-1))


def agree(ours: Floats, theirs: Floats) -> None:
    error = np.sqrt(sum(images.var(axis=0, ddof=1) / len(images) for images in (ours, theirs)))
    assert (error < 6e-3 * theirs.mean(axis=0)).all()
    # Seven degrees of freedom on each side.
    assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 5.5 * error).all()


@pytest.mark.thorough
def test_the_radiance_is_that_of_plain_mitsuba(world: World, plain: Floats) -> None:
    size = np.full(len(PIXELS), 64)
    ours = [
        trace(world, PIXELS, size, scene_seed(100 * seed), "whole").radiance for seed in range(8)
    ]
    agree(bands(np.reshape(ours, plain.shape)), bands(plain))


@pytest.mark.thorough
def test_frames_on_the_static_layer_have_it_too(world: World, plain: Floats) -> None:
    target = NoiseTarget(lambda radiance: 0.1 * radiance + 1e-4)
    ours = []
    for seed in range(8):
        static = render_static_layer(world, target, scene_seed(10 * seed))
        ours.append(render_frame(world, static, target, scene_seed(10 * seed + 1)).radiance)
    agree(bands(np.array(ours)), bands(plain))


@pytest.mark.thorough
def test_reflections_are_seen(world: World, plain: Floats) -> None:
    direct = World(
        CAMERA, world.lights, world._surfaces, world.unit, still={"background"}, bounces=1
    )
    once = trace(direct, PIXELS, np.full(len(PIXELS), 16), scene_seed(1), "whole").radiance
    assert plain.mean() > 1.05 * once.mean()
