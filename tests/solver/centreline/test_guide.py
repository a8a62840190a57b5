"""Between image and beam, through a lens that shows nothing in the image's corners."""

import numpy as np

from solver.centreline.finding import find_path
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise
from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at

# The image of r (1 - r^2 / 4) ends at r = 1.155, 0.77 of a focal length from the axis: here the
# corners lie 0.93 off.
FOLDING = (-0.25, 0.0, 0.0, 0.0, 0.0)


def wide_angle() -> Guide:
    pose = camera_looking_at(np.array([0.12, 0.0, 0.1]), np.array([0.12, 0.0, 0.0]), 0.0)
    camera = Camera(320, 240, 215, 215, 159.5, 119.5, pose, distortion=FOLDING)
    return Guide(camera, np.eye(4), 0.2, 1e-3)


def test_corners_are_nowhere_and_the_middle_is_where_it_was() -> None:
    guide = wide_angle()
    places = guide.places(np.array([[0.0, 0.0], [159.5, 119.5], [319.0, 239.0]]))
    assert np.isnan(places[[0, 2]]).all()
    assert np.abs(places[1] - [0.12, 0.0]).max() < 1e-9


def test_a_speck_in_a_corner_does_not_hide_the_beam() -> None:
    guide = wide_angle()
    image = np.full((240, 320), 20, np.uint8)
    line = guide.pixels(np.column_stack([np.linspace(0, 0.2, 400), np.zeros(400)]))
    image[np.rint(line[:, 1]).astype(int), np.rint(line[:, 0]).astype(int)] = 200
    clean = find_path(image, guide, 1, Noise(1.0, 0.0), 0.0)
    image[232:234, :30] = 200
    specked = find_path(image, guide, 1, Noise(1.0, 0.0), 0.0)
    assert clean is not None
    assert specked is not None
    assert np.abs(specked - clean).max() < guide.pixel
