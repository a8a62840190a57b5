"""Dust and smudges on a beam: as much as stated, and where the beam is."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.draws import scene_seed
from tests.vbaa_bench.render.test_hidden_strip import bent
from tests.vbaa_bench.render.test_thin_beams import CAMERA, MIDDLE
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.geometry.textures import Grime, Texture, grime_texture
from vbaa_bench.geometry.tube import arc_length_of_vertices, around_of_vertices, tube
from vbaa_bench.render.layers import every_pixel
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.lights.ambient import Ambient

LENGTH = 0.024
PIXELS = np.argwhere(np.ones((CAMERA.height, CAMERA.width)))[:, ::-1]


def test_dust_covers_the_stated_share(random: np.random.Generator) -> None:
    grime = Grime(0.2, 4e-3, 0.06, 0.1e-3, 0.9, 0.4)
    texture = grime_texture(grime, 0.3, 0.1, 2.5e-3, random)
    dusty = texture.image == 0.9
    assert texture.gloss is not None
    # The field has the share in its whole period, of which one half is kept.
    assert dusty.mean() == pytest.approx(0.06, rel=0.2)
    assert (texture.gloss[dusty] == 0).all()
    clean = texture.image[~dusty]
    assert clean.mean() == pytest.approx(0.3, rel=0.1)
    assert clean.std() / clean.mean() == pytest.approx(0.2, rel=0.25)
    assert texture.gloss[~dusty].mean() == pytest.approx(0.8, abs=0.08)


@pytest.mark.false_alarm(0.0, "the gloss is bounded")
def test_gloss_is_between_the_stated_share_and_one(random: np.random.Generator) -> None:
    texture = grime_texture(Grime(0.2, 4e-3, 0.0, 0.1e-3, 0.9, 0.4), 0.3, 0.1, 2.5e-3, random)
    assert texture.gloss is not None
    assert 0.6 <= texture.gloss.min() < 0.7
    assert 0.9 < texture.gloss.max() <= 1.0


def beam_world(texture: Texture | None) -> World:
    """A bent matt beam over black ground, under even light."""
    s = np.linspace(0, LENGTH, 60)
    skin = tube(bent(0.0), 6e-4, 24, caps_apart=True)
    around = None if texture is None else around_of_vertices(60, 24)
    beam = Surface(
        skin,
        0.5,
        arc_length=arc_length_of_vertices(s, 24),
        smooth=True,
        texture=texture,
        around=around,
    )
    surfaces = {"beam": beam, "background": Surface(sheet(MIDDLE - [0, 0, 0.006], 2.0, 1), 0.0)}
    return World(CAMERA, Ambient(1.0), surfaces, RenderUnit(6e-4, MIDDLE), still={"background"})


def radiance(world: World) -> Floats:
    size = np.full(len(PIXELS), 64)
    return trace(world, PIXELS, size, scene_seed(1), "whole").radiance.reshape(
        CAMERA.height, CAMERA.width
    )


@pytest.mark.thorough
def test_a_texture_follows_the_arc_length(variant: str) -> None:
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts whole images are rendered")
    # From 0 at the clamp to 1 at the tip, between the centres of two texels.
    ramp = Texture(np.array([[0.0, 1.0]]), np.empty((0, 2)), per_mm=1e-3 / LENGTH)
    plain, graded = beam_world(None), beam_world(ramp)
    layers = every_pixel(graded)
    # The truth does not depend on the paint.
    assert layers.arc_length_mm == pytest.approx(every_pixel(plain).arc_length_mm, abs=1e-4)
    covered = layers.beam_mask & (radiance(plain) > 0.4)
    ratio = 0.5 * radiance(graded)[covered] / radiance(plain)[covered]
    fraction = layers.arc_length_mm[covered] / (1e3 * LENGTH)
    expected = np.clip(2 * fraction - 0.5, 0, 1)
    assert covered.sum() > 60
    assert ratio == pytest.approx(expected, abs=0.03)


def test_a_texture_goes_around_the_beam(variant: str) -> None:
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts whole images are rendered")
    # Bright on the side of +y, dark on that of -y.
    sides = Texture(np.array([[1.0], [0.0]]), np.empty((0, 2)), per_mm=1e-3 / LENGTH)
    image = radiance(beam_world(sides))
    towards_y = CAMERA.project(MIDDLE + np.array([[0.0, 0.0, 0.0], [0.0, 1e-3, 0.0]]))
    up = towards_y[1, 1] < towards_y[0, 1]
    columns = np.flatnonzero(image.max(axis=0) > 0.1)
    for column in columns[len(columns) // 4 : -len(columns) // 4 : 20]:
        lit = np.flatnonzero(image[:, column] > 0.02)
        first, second = np.array_split(image[lit, column], 2)
        bright, dark = (first, second) if up else (second, first)
        assert bright.mean() > 2 * dark.mean()
