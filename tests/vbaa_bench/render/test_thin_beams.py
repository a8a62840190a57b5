"""Beams about as wide as a pixel or thinner, on and between rows: no noisier than wanted."""

import cv2
import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at
from tests.consistency import MOST_SIGMAS
from tests.draws import scene_seed
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.geometry.tube import arc_length_of_vertices, tube
from vbaa_bench.render.frame import NoiseTarget, StaticLayer, render_frame, render_static_layer
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.lights.emitter import Lamp

MIDDLE, PIXEL, DEPTH = np.array([0.12, 0.0, 0.0]), 0.5e-3, 0.36
FACETS, RINGS, HALF_LENGTH_PX = 12, 13, 18
CAMERA = Camera(
    56,
    40,
    DEPTH / PIXEL,
    DEPTH / PIXEL,
    27.5,
    19.5,
    camera_looking_at(MIDDLE + np.array([0.0, 0.0, DEPTH]), MIDDLE, 0.0),
)
WIDTHS_PX = (0.3, 0.5, 0.8, 1.6)
# Angle [deg] and shift [px]: 0 is between two rows, or columns, of CAMERA, a half on one.
PLACES = ((0.0, 0.0), (0.0, 0.5), (0.6, 0.0), (30.0, 0.0), (90.0, 0.0), (90.0, 0.5))
IMAGES = 10
WIDE_PX = 60.0


def noise(radiance: Floats) -> Floats:
    """A sensor's, whose shots grow with the square root of light."""
    return np.asarray(0.01 * np.sqrt(np.maximum(radiance, 1e-3)))


TARGET = NoiseTarget(noise)


def beam(width_px: float, angle_deg: float, shift_px: float) -> Floats:
    """Vertices of a straight beam's skin in plane C [m]."""
    angle = np.radians(angle_deg)
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    share = np.linspace(-HALF_LENGTH_PX, HALF_LENGTH_PX, RINGS)[:, None]
    line = MIDDLE + PIXEL * (share * along + shift_px * across)
    return np.asarray(tube(line, width_px * PIXEL / 2, FACETS, caps_apart=True).vertices)


def world_before(camera: Camera) -> World:
    share = np.linspace(-HALF_LENGTH_PX, HALF_LENGTH_PX, RINGS)[:, None] * [PIXEL, 0, 0]
    skin = tube(MIDDLE + share, PIXEL, FACETS, caps_apart=True)
    arc_length = arc_length_of_vertices(np.linspace(0, 0.018, RINGS), FACETS)
    surfaces = {
        "beam": Surface(skin, 0.85, "gloss", arc_length=arc_length, smooth=True),
        "background": Surface(sheet(MIDDLE - [0, 0, 0.03], 4.8, 1), 0.05),
    }
    lamp = Lamp(sheet(np.array([0.12, 0.0, 0.42]), 0.7, -1))
    return World(camera, lamp, surfaces, RenderUnit(4e-4, MIDDLE), still={"background"})


@pytest.fixture(scope="module")
def world(variant: str) -> World:
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts every pixel gets the same samples")
    return world_before(CAMERA)


@pytest.fixture(scope="module")
def ground(world: World) -> StaticLayer:
    return render_static_layer(world, TARGET, scene_seed(1))


@pytest.mark.thorough
@pytest.mark.parametrize("width_px", WIDTHS_PX)
def test_no_column_is_noisier_than_wanted_nor_biased(
    world: World, ground: StaticLayer, width_px: float
) -> None:
    worst, biases, chances = [], [], []
    for angle_deg, shift_px in PLACES:
        world.move({"beam": beam(width_px, angle_deg, shift_px)})
        made = [
            render_frame(world, ground, TARGET, scene_seed(100 + seed)) for seed in range(IMAGES)
        ]
        radiance = np.array([one.radiance for one in made])
        covered = np.mean([one.coverage for one in made], axis=0) > 0
        near = cv2.dilate(covered.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        # Along the beam: of its columns, or of its rows where it runs down the image.
        axis = 1 if angle_deg > 45 else 0
        spread = np.where(near, radiance.var(axis=0, ddof=1), 0).sum(axis=axis)
        allowed = np.where(near, noise(radiance.mean(axis=0)) ** 2, 0).sum(axis=axis)
        worst.append(float(np.sqrt((spread[allowed > 0] / allowed[allowed > 0]).max())))
        rows, columns = np.nonzero(near)
        pixels, many = np.column_stack([columns, rows]), np.full(len(rows), 512)
        parts = [trace(world, pixels, many, scene_seed(10**7 * part), "whole") for part in (1, 2)]
        truth = np.mean([part.radiance.sum() for part in parts])
        light = radiance[:, near].sum(axis=1)
        biases.append(light.mean() / truth - 1)
        # All images share the static layer and its noise.
        static = TARGET.static * noise(ground.radiance[near])
        chances.append(np.sqrt(light.var(ddof=1) / IMAGES + (static**2).sum()) / truth)
    # The worst of 200 columns has up to 1.5 times the sensor's noise (60 images), and ten images
    # show up to 2 times. An unsampled column has 10 to 50 times.
    assert max(worst) < 4.0
    # In total light, over all beams: chance leaves 0.01 % each.
    chance = np.sqrt(np.mean(np.square(chances)) / len(biases))
    assert abs(np.mean(biases)) < max(MOST_SIGMAS * chance, 1e-4)


@pytest.mark.parametrize("k1", [0.0, -0.3, 0.3])
@pytest.mark.usefixtures("world")
def test_the_hull_holds_every_pixel_that_a_beam_touches(k1: float) -> None:
    # From nearer, at the wide angles at which a lens distorts much.
    pose = camera_looking_at(MIDDLE + np.array([0.0, 0.0, WIDE_PX * PIXEL]), MIDDLE, 0.0)
    coefficients = (k1, 0.0, 0.0, 0.0, 0.0) if k1 else ()
    wide = Camera(56, 40, WIDE_PX, WIDE_PX, 27.5, 19.5, pose, distortion=coefficients)
    scene = world_before(wide)
    everywhere = np.ones((CAMERA.height, CAMERA.width), np.bool_)
    rows, columns = np.nonzero(everywhere)
    pixels, many = np.column_stack([columns, rows]), np.full(len(rows), 64)
    for angle_deg, shift_px in [(3.0, 14.0), (40.0, 3.0)]:
        scene.move({"beam": beam(0.4, angle_deg, shift_px)})
        covered = (
            trace(scene, pixels, many, scene_seed(3), "whole").coverage.reshape(everywhere.shape)
            > 0
        )
        hull = scene.view.hulls(scene.bodies({"beam"}), 0)
        assert covered.sum() > 30
        assert not (covered & ~hull).any()
        assert hull.mean() < 0.4
