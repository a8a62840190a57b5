"""The first render test: Mitsuba's picture of a point lies where OpenCV projects it."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at
from tests.even import REACH_PX, even_picture
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.variant import PLAIN, activate
from vbaa_bench.render.world import World
from vbaa_bench.scene.lights.emitter import Lamp

POINTS = np.array(
    [
        [0.02, -0.03, 0.0],
        [0.12, 0.02, 0.0],
        [0.23, 0.05, 0.0],
        [0.05, 0.06, 0.02],
        [0.2, -0.05, -0.03],
    ]
)


def skewed_camera() -> Camera:
    pose = camera_looking_at(np.array([0.1, 0.05, 0.36]), np.array([0.13, 0.0, 0.0]), 0.3)
    # Not square, and its principal point well off the middle, each way by another amount.
    return Camera(320, 256, 400.0, 400.0, 170.3, 115.8, pose)


def telecentric_camera(distance: float = 0.36) -> Camera:
    """Leaning, rolled, its axis off the image's middle, `distance` [m] from where it looks."""
    middle = np.array([0.13, 0.0, 0.0])
    leaning = np.array([-0.1, 0.2, math.sqrt(0.95)])
    pose = camera_looking_at(middle + distance * leaning, middle, 0.3)
    return Camera(320, 256, 1000.0, 1000.0, 170.3, 115.8, pose, telecentric=True)


def picture_of_points(
    camera: Camera,
    scale: float = 1.0,
    lamp_height: float = 0.6,
    samples: int = 512,
    about: Floats | None = None,
) -> Floats:
    """White squares about POINTS, facing an even light on the camera's side, all lengths scaled."""
    squares = [sheet(point * scale, 0.003 * scale, 1) for point in POINTS]
    marks = trimesh.Trimesh(
        np.vstack([square.vertices for square in squares]),
        np.vstack([square.faces + 4 * i for i, square in enumerate(squares)]),
        process=False,
    )
    pose = camera.camera_from_antenna.copy()
    pose[:3, 3] *= scale
    # A pinhole's focal length is in pixels, a telecentric camera's magnification is per metre.
    focal = camera.fx / scale if camera.telecentric else camera.fx
    scaled = replace(camera, fx=focal, fy=focal, camera_from_antenna=pose)
    lamp = Lamp(sheet(np.array([0.12, 0.0, lamp_height]) * scale, 2.0 * scale, -1))
    unit = RenderUnit(0.4e-3 * scale, np.array([0.12, 0.0, 0.0]) * scale)
    world = World(scaled, lamp, {"marks": Surface(marks, 0.9)}, unit)
    return even_picture(world, samples, 1, about)


def centroids(image: Floats, expected: Floats) -> Floats:
    found, near = [], np.arange(-REACH_PX, REACH_PX + 1)
    for u, v in np.rint(expected).astype(int):
        rows, columns = np.meshgrid(v + near, u + near, indexing="ij")
        part = image[rows, columns]
        found.append([(columns * part).sum() / part.sum(), (rows * part).sum() / part.sum()])
    return np.array(found)


@pytest.fixture(scope="module", autouse=True)
def _renderer(variant: str) -> None:
    activate(variant, 2)


def test_mitsuba_sees_what_opencv_projects() -> None:
    camera = skewed_camera()
    rotation, _ = cv2.Rodrigues(camera.camera_from_antenna[:3, :3])
    expected, _ = cv2.projectPoints(
        POINTS, rotation, camera.camera_from_antenna[:3, 3], camera.matrix, np.zeros(5)
    )
    pixels = np.asarray(expected, dtype=np.float64).reshape(-1, 2)
    assert camera.project(POINTS) == pytest.approx(pixels, abs=1e-9)
    # Half a pixel, a mirrored axis or a wrong sign would show as 0.5 px and more; perspective
    # within a square, and the light's gradient over it, as a few thousandths.
    error = centroids(picture_of_points(camera, about=pixels), pixels) - pixels
    assert np.abs(error).max() < 0.02


@pytest.mark.parametrize(("width", "height"), [(320, 256), (256, 320), (320, 320), (500, 240)])
def test_mitsuba_sees_what_a_telecentric_camera_projects(width: int, height: int) -> None:
    camera = replace(telecentric_camera(), width=width, height=height)
    # Wherever the image's middle is, the axis stays where all the points are in view.
    camera = replace(camera, cx=camera.cx + (width - 320) / 2, cy=camera.cy + (height - 256) / 2)
    pixels = camera.project(POINTS)
    # A lamp far off is nearly a point, whose light has hardly any noise.
    image = picture_of_points(camera, lamp_height=12.0, about=pixels)
    error = centroids(image, pixels) - pixels
    assert np.abs(error).max() < 0.02


def test_a_telecentric_camera_far_off_loses_no_digits() -> None:
    """From 18,000 units of the renderer, as a micropipette's radius under a microscope."""
    camera = telecentric_camera(distance=7.2)
    pixels = camera.project(POINTS)
    assert pixels == pytest.approx(telecentric_camera().project(POINTS), abs=1e-9)
    image = picture_of_points(camera, lamp_height=12.0, about=pixels)
    error = centroids(image, pixels) - pixels
    assert np.abs(error).max() < 0.02


@pytest.mark.parametrize("camera", [skewed_camera(), telecentric_camera()], ids=["pinhole", "tele"])
def test_the_unit_of_length_does_not_matter(camera: Camera) -> None:
    one, small = (picture_of_points(camera, scale, samples=64) for scale in (1.0, 1e-4))
    # The same rays up to rounding: a few edge samples may fall to the other side.
    assert np.abs(small - one).max() < 0.05 * one.max()
    assert np.abs(small - one).mean() < 1e-5 * one.max()


def test_an_unusable_llvm_is_survived(tmp_path: Path) -> None:
    """A library that is no LLVM: the probe says so, and the plain variant is chosen."""
    code = (
        "from vbaa_bench.render.variant import choose\n"
        "print(choose())"  # probes the fast variant first
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PATH": "/usr/bin:/bin", "DRJIT_LIBLLVM_PATH": str(tmp_path / "none.so")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [PLAIN]
