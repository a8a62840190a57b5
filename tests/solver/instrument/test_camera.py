"""The camera: the border of its image, where it is seen from, and points of plane C."""

from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at

PLACE = np.array([0.12, 0.02, 0.36])
POSE = camera_looking_at(PLACE, np.array([0.13, 0.01, 0.0]), 0.1)
CAMERA = Camera(200, 100, 300.0, 310.0, 99.0, 50.0, POSE, distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))
MICROSCOPE = replace(CAMERA, fx=900.0, fy=900.0, telecentric=True, distortion=())


def test_the_image_ends_half_a_pixel_beyond_the_outer_centres() -> None:
    inside = [[-0.49, -0.49], [199.49, 99.49], [0.0, 50.0]]
    outside = [[-0.51, 50.0], [199.51, 50.0], [100.0, -0.51], [100.0, 99.51]]
    assert CAMERA.contains(np.array(inside)).all()
    assert not CAMERA.contains(np.array(outside)).any()


def test_directions_point_to_the_lens_or_along_the_parallel_rays() -> None:
    points = np.array([[0.1, 0.0, 0.0], [0.2, 0.01, 0.05]])
    directions = CAMERA.directions_from(points)
    distance = np.linalg.norm(PLACE - points, axis=1)
    np.testing.assert_allclose(points + distance[:, None] * directions, [PLACE, PLACE])
    parallel = MICROSCOPE.directions_from(points)
    np.testing.assert_allclose(
        MICROSCOPE.project(points + 0.1 * parallel), MICROSCOPE.project(points)
    )
    np.testing.assert_allclose(np.linalg.norm(parallel, axis=1), 1.0)


@pytest.mark.parametrize("camera", [CAMERA, MICROSCOPE])
def test_points_on_the_plane_have_the_pixels_of_which_they_are_made(camera: Camera) -> None:
    pixels = np.array([[10.0, 20.0], [150.5, 80.25]])
    points = camera.on_plane(pixels)
    assert not points[:, 2].any()
    np.testing.assert_allclose(camera.project(points), pixels, atol=1e-8)
