"""What a real lens adds: distortion, spread, depth of field; each against its closed form."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.transforms import camera_looking_at
from tests.even import even_picture
from tests.vbaa_bench.render.test_camera import POINTS, centroids, skewed_camera
from vbaa_bench.dataset.target import FAST
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.render.optics import Lens
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.variant import PLAIN, activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.lights.emitter import Lamp


@pytest.fixture(scope="module", autouse=True)
def _renderer(variant: str) -> None:
    activate(variant, 2)
    if is_scalar():
        pytest.skip("a scalar variant has an ideal lens alone")


def marks(points: Floats, side: float = 0.003) -> dict[str, Surface]:
    """White squares (n, 3) [m] that face +z."""
    squares = [sheet(point, side, 1) for point in points]
    mesh = trimesh.Trimesh(
        np.vstack([square.vertices for square in squares]),
        np.vstack([square.faces + 4 * i for i, square in enumerate(squares)]),
        process=False,
    )
    return {"marks": Surface(mesh, 0.9)}


def world(camera: Camera, points: Floats, side: float = 0.003, lens: Lens | None = None) -> World:
    # A lamp far off is nearly a point, whose light has hardly any noise.
    lamp = Lamp(sheet(np.array([0.12, 0.0, 12.0]), 2.0, -1))
    unit = RenderUnit(0.4e-3, np.array([0.12, 0.0, 0.0]))
    return World(camera, lamp, marks(points, side), unit, lens=lens)


@pytest.mark.parametrize(
    "distortion",
    [(-0.3, 0.12, 0.002, -0.001, 0.01), (0.1, -0.05, 0.001, 0.002, 0.02, 0.3, 0.01, 0.02)],
    ids=["five", "eight"],
)
def test_mitsuba_sees_what_a_distorting_lens_projects(distortion: tuple[float, ...]) -> None:
    camera = replace(skewed_camera(), distortion=distortion)
    pixels = camera.project(POINTS)
    assert np.abs(pixels - skewed_camera().project(POINTS)).max() > 1
    image = even_picture(world(camera, POINTS), 1024, 1, pixels)
    error = centroids(image, pixels) - pixels
    # The middle of a square's image is not the image of its middle: up to 0.005 px here.
    assert np.abs(error).max() < 0.03


def straight_camera() -> Camera:
    pose = camera_looking_at(np.array([0.12, 0.0, 0.36]), np.array([0.12, 0.0, 0.0]), 0.0)
    return Camera(64, 64, 700.0, 700.0, 31.5, 31.5, pose)


def spread(image: Floats) -> Floats:
    """Variance [px^2] of an image's light along u and v."""
    rows, columns = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    total = image.sum()
    found = []
    for place in (columns, rows):
        mean = (place * image).sum() / total
        found.append(((place - mean) ** 2 * image).sum() / total)
    return np.array(found)


@pytest.mark.thorough
def test_a_point_spreads_as_a_gaussian() -> None:
    point, side = np.array([[0.12, 0.0, 0.0]]), 3e-3
    sharp, wide = (
        even_picture(world(straight_camera(), point, side, lens), 4096, 1)
        for lens in (None, Lens(point_spread_px=3.0))
    )
    assert spread(wide) - spread(sharp) == pytest.approx([3.0**2] * 2, rel=0.02)
    assert wide.sum() == pytest.approx(sharp.sum(), rel=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("height", [-0.06, 0.05])
def test_out_of_focus_a_point_is_a_disc(height: float) -> None:
    point, side, aperture, focus = np.array([[0.12, 0.0, height]]), 3e-3, 20e-3, 0.36
    lens = Lens(aperture=aperture, focus=focus)
    camera = straight_camera()
    sharp, wide = (even_picture(world(camera, point, side, each), 4096, 1) for each in (None, lens))
    depth = 0.36 - height
    radius = camera.fx * aperture * abs(1 / focus - 1 / depth)
    # Of a disc of even light, along any diameter.
    assert spread(wide) - spread(sharp) == pytest.approx([radius**2 / 4] * 2, rel=0.03)
    assert world(camera, point, side, lens).blur_px in (int(radius), int(radius) + 1)


def test_what_lies_in_focus_stays_sharp() -> None:
    point = np.array([[0.12, 0.0, 0.0]])
    one, other = (
        even_picture(world(straight_camera(), point, 2e-3, lens), 256, 1)
        for lens in (None, Lens(aperture=5e-3, focus=0.36))
    )
    assert np.abs(one - other).max() < 0.05 * one.max()


def test_a_scalar_variant_refuses_a_real_lens() -> None:
    activate(PLAIN, 1)
    try:
        with pytest.raises(InputError, match="cannot distort, spread or defocus"):
            world(straight_camera(), POINTS, lens=Lens(point_spread_px=1.0))
    finally:
        activate(FAST, 2)
