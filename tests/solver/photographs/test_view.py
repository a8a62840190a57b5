"""The view of plane C: its inverse, its derivatives, and OpenCV's projection."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.photographs.view import FOCAL, K1, PARAMETERS, ROLL, SCALE, images_of, places_of
from tests.draws import generator
from tests.photo_sets import HEIGHT, WIDTH, TrueCamera

VIEW = np.array([-1300.0, 200.0, 0.3, np.log(2700.0), 0.08, -0.05, np.log(3000.0), -0.07])


@pytest.fixture
def places() -> Floats:
    return generator(__name__, 0).uniform([0.0, -0.3], [1.0, 0.3], (40, 2))


def test_places_are_those_of_their_images(places: Floats) -> None:
    images = images_of(places, VIEW)
    assert images is not None
    back = places_of(images.pixels, VIEW)
    assert back is not None
    assert back.points == pytest.approx(places, abs=1e-12)
    assert back.by_pixel @ images.by_place == pytest.approx(np.tile(np.eye(2), (40, 1, 1)))


def test_derivatives_are_differences(places: Floats) -> None:
    images = images_of(places, VIEW)
    assert images is not None
    back = places_of(images.pixels, VIEW)
    assert back is not None
    for i in range(PARAMETERS):
        step = np.zeros(PARAMETERS)
        step[i] = 1e-6 * max(1.0, abs(VIEW[i]))
        ahead, behind = images_of(places, VIEW + step), images_of(places, VIEW - step)
        inverse = places_of(images.pixels, VIEW + step), places_of(images.pixels, VIEW - step)
        assert ahead
        assert behind
        assert inverse[0]
        assert inverse[1]
        moved = (ahead.pixels - behind.pixels) / (2 * step[i])
        assert images.by_view[:, :, i] == pytest.approx(moved, rel=1e-5, abs=1e-4)
        moved = (inverse[0].points - inverse[1].points) / (2 * step[i])
        assert back.by_view[:, :, i] == pytest.approx(moved, rel=1e-5, abs=1e-8)


def test_the_view_is_that_of_a_camera_of_opencv(places: Floats) -> None:
    camera = TrueCamera(focal=3000.0, k1=-0.07, roll=0.3, view=(0.08, -0.05), aim=(0.0, 0.0))
    length = 0.4
    view = np.zeros(PARAMETERS)
    view[[ROLL, *range(4, 6)]] = camera.roll, *camera.view
    view[SCALE], view[FOCAL] = np.log(camera.focal * length / camera.distance), np.log(camera.focal)
    view[K1] = camera.k1
    images = images_of(places, view)
    assert images is not None
    pixels = camera.pixels(places * length, length) - (np.array([WIDTH, HEIGHT]) - 1) / 2
    assert images.pixels == pytest.approx(pixels, abs=1e-6)


def test_nothing_behind_the_camera_is_seen() -> None:
    turned = VIEW.copy()
    turned[5] = np.radians(80)
    assert images_of(np.array([[-3.0, 0.0], [3.0, 0.0]]), turned) is None
