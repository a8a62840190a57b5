"""Information of an image: a straight line's closed form, and two parameters that are one."""

import numpy as np

from solver.instrument.arrays import Floats
from tests.vbaa_bench.limits.test_image_shape import imaged, shape_of
from vbaa_bench.limits.frame_information import (
    PlacesInformation,
    frame_information,
)
from vbaa_bench.limits.profile import SHIFT, SurfaceProfile, information
from vbaa_bench.mechanics.loaded import Load

ACROSS_ROWS = np.array([0.0, 1.0])
BAR = SurfaceProfile(np.full(100, 3.0), 1.0, 2.0, ACROSS_ROWS)
# A pixel in the image of the beam's plane [px/m].
SCALE = 700 / 0.36


def steady(mean: Floats) -> Floats:
    """Noise with the same variance, 0.01, in all pixels."""
    return np.full_like(mean, 0.01)


def of_bar(visible: Floats) -> PlacesInformation:
    return PlacesInformation(visible[:, None, None] * information(BAR, steady))


def test_a_straight_line_has_the_information_of_linear_regression() -> None:
    shape = shape_of(imaged(Load(0.14, 1e-9)), ["clamp_y", "motor_angle"])
    total = frame_information(shape, of_bar(np.ones(200)))
    per_metre = information(BAR, steady)[SHIFT, SHIFT] * SCALE
    # The integrals of 1, x and x^2 over the length, times the squared scale.
    integrals = np.array([[0.24, 0.24**2 / 2], [0.24**2 / 2, 0.24**3 / 3]])
    np.testing.assert_allclose(total.matrix[:2, :2], SCALE**2 * per_metre * integrals, rtol=1e-4)


def test_hidden_places_inform_on_nothing() -> None:
    shape = shape_of(imaged(), ["s_c", "normal_force"])
    half = (np.arange(200) < 100).astype(float)
    parts = [
        frame_information(shape, of_bar(visible)) for visible in (half, 1 - half, np.ones(200))
    ]
    np.testing.assert_allclose(parts[0].matrix + parts[1].matrix, parts[2].matrix, rtol=1e-12)
    assert np.linalg.eigvalsh(parts[0].matrix[:2, :2]).min() > 0


def test_an_image_informs_on_force_over_rigidity_only() -> None:
    names = ["s_c", "normal_force", "rigidity"]
    shape = shape_of(imaged(), names)
    total = frame_information(shape, of_bar(np.ones(200)))
    beam = imaged()
    unit = np.array([beam.unit(name) for name in names])
    relative = total.matrix[:3, :3] * np.outer(unit, unit)
    together = np.array([0.0, 1.0, 1.0])  # force and rigidity larger by the same factor
    assert together @ relative @ together < 1e-6 * relative[1, 1]
