"""Paints send back what they should, and textures lie where they should."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.draws import generator, scene_seed
from vbaa_bench.geometry.textures import gradient_texture, random_texture
from vbaa_bench.render.loading import load
from vbaa_bench.render.materials import bsdf
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.paint import Paint


@pytest.fixture(scope="module", autouse=True)
def _renderer(variant: str) -> None:
    activate(variant, 2)


def under_even_light(paint: Paint, roughness: float) -> Floats:
    """Radiance (16, 16) of a square from above, under radiance 1 from all around."""
    described = {
        "type": "scene",
        "light": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
        "sheet": {"type": "rectangle", "bsdf": bsdf(paint, 0.6, roughness)},
        "integrator": {"type": "direct"},
        "sensor": {
            "type": "orthographic",
            # From above, x to the right and y up.
            "to_world": mi.ScalarTransform4f().look_at(
                origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0]
            ),
            "film": {
                "type": "hdrfilm",
                "width": 16,
                "height": 16,
                "pixel_format": "luminance",
                "rfilter": {"type": "box"},
            },
        },
    }
    image = mi.render(load(described), spp=256, seed=mi.UInt32(scene_seed(1)))
    return np.asarray(image, dtype=float)[:, :, 0]


@pytest.mark.parametrize(
    ("paint", "roughness", "expected"),
    [
        ("matt", 0.3, 0.6),
        ("black", 0.3, 0.03),
        # Fresnel's formula at right angles for iron: ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
        ("bare", 0.3, (1.95**2 + 2.93**2) / (3.95**2 + 2.93**2)),
    ],
)
def test_a_paint_sends_back_its_share(paint: Paint, roughness: float, expected: float) -> None:
    image = under_even_light(paint, roughness)
    assert image.mean() == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("paint", ["gloss", "bare"])
@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6])
def test_no_paint_makes_light(paint: Paint, roughness: float) -> None:
    assert 0.35 < under_even_light(paint, roughness).mean() < 0.7


def test_a_graded_sheet_is_a_straight_line_of_reflectance() -> None:
    # Across a square of side 2 towards +y, from its middle: 0.1 to 0.5 within 4, then constant.
    y = np.array([-9.0, -2.0, -1.0, 0.0, 0.3, 1.0, 2.0, 9.0])
    places = np.column_stack([np.linspace(-5, 5, 8), y])
    texture = gradient_texture(places, 0.1, 0.5, np.deg2rad(90), 4.0)
    bitmap = load(bsdf("matt", 0.0, 0.3, texture)["bsdf"]["reflectance"])
    seen = []
    for u, v in texture.uv:
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.uv = mi.Point2f(float(u), float(v))
        seen.append(float(np.ravel(bitmap.eval_1(si))[0]))
    assert seen == pytest.approx([0.1, 0.1, 0.2, 0.3, 0.33, 0.4, 0.5, 0.5], rel=1e-6)


def test_a_grown_texture_has_the_stated_mean_contrast_and_correlation(
    random: np.random.Generator,
) -> None:
    places = np.zeros((4, 2))
    correlation = (6e-3, 2e-3)
    texture = random_texture(places, 0.2, 0.3, correlation, 0.5, random)
    image = texture.image
    assert image.mean() == pytest.approx(0.2, rel=0.02)
    assert image.std() / image.mean() == pytest.approx(0.3, rel=0.05)
    field = np.log(image)
    field = (field - field.mean()) / field.std()
    # A texel is an eighth of the correlation length: after eight, 1/e; after sixteen, its square.
    for axis in (0, 1):
        for texels, expected in ((8, np.exp(-1)), (16, np.exp(-2))):
            got = (field * np.roll(field, texels, axis=axis)).mean()
            assert got == pytest.approx(expected, abs=0.055)


def test_a_texture_is_its_generators_and_repeats_without_a_seam() -> None:
    def made(seed: int) -> Floats:
        random = generator(__name__, seed)
        return random_texture(np.zeros((4, 2)), 0.2, 0.3, (2e-3, 2e-3), 0.1, random).image

    image = made(1)
    assert (made(1) == image).all()
    assert (made(2) != image).any()
    step = np.abs(np.diff(image, axis=1)).mean()
    assert np.abs(image[:, 0] - image[:, -1]).mean() == pytest.approx(step, rel=0.5)
    texture = random_texture(
        np.array([[0.1, 0.0]]), 0.2, 0.3, (2e-3, 2e-3), 0.1, generator(__name__, 1)
    )
    assert texture.uv[0, 0] == pytest.approx(1.0)
