"""The beam's image: its changes and its information in known cases, independence of the step."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.optimize import brentq

from solver.beams.exact import bend_at, contact_at
from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at
from vbaa_bench.limits import imaged_beam as module
from vbaa_bench.limits.image_shape import (
    ImageShape,
    PlacesInformation,
    image_information,
    image_shape,
)
from vbaa_bench.limits.imaged_beam import PARAMETERS, ImagedBeam
from vbaa_bench.limits.profile import SHIFT, SurfaceProfile, information
from vbaa_bench.mechanics.loaded import Load
from vbaa_bench.mechanics.rod import Rod

BEAM = Beam(0.24, 0.8e-3, circular_rigidity(200e9, 0.8e-3))
# Looking straight down, 0.36 m above the beam's plane: x right, y down in the image.
POSE = camera_looking_at(np.array([0.12, 0.018, 0.36]), np.array([0.12, 0.018, 0.0]), 0.0)
CAMERA = Camera(512, 512, 700.0, 700.0, 255.5, 255.5, POSE)
LOAD = Load(0.14, 0.15)
ACROSS_ROWS = np.array([0.0, 1.0])
BAR = SurfaceProfile(np.full(100, 3.0), 1.0, 2.0, ACROSS_ROWS)
# A pixel in the image of the beam's plane [px/m].
SCALE = 700 / 0.36


def imaged(load: Load = LOAD) -> ImagedBeam:
    return ImagedBeam(Rod(BEAM), (load,), CAMERA, np.eye(4))


def shape_of(beam: ImagedBeam, names: Sequence[str]) -> ImageShape:
    return image_shape(beam, beam.neighbours(names))


def exact_line(q: float, lever: float, x: Floats) -> Floats:
    """Compute y of the closed form at x up to the contact, in metres."""
    (theta, *_), (x_c, *_), (y_c, *_), _ = contact_at(q, lever)
    u = np.linspace(0, lever, 4001)
    across = np.array([bend_at(value, q)[0] for value in u])
    along_x = x_c - u * np.cos(theta) - across * np.sin(theta)
    along_y = y_c - u * np.sin(theta) + across * np.cos(theta)
    return np.asarray(np.interp(x, along_x[::-1], along_y[::-1]))


def test_the_image_has_its_length() -> None:
    shape = shape_of(imaged(Load(0.14, 1e-9)), ["s_c"])
    assert shape.steps.sum() == pytest.approx(700 * 0.24 / 0.36, rel=1e-6)


def test_a_moved_clamp_moves_the_image_of_a_straight_beam() -> None:
    names = ["clamp_x", "clamp_y", "motor_angle", "cx", "cy"]
    shape = shape_of(imaged(Load(0.14, 1e-9)), names)
    scale = 700 / 0.36
    x = (np.arange(200) + 0.5) / 200 * 0.24
    sign = np.sign(shape.normals[0, 1]) * np.sign(
        CAMERA.project(np.array([[0, 1e-3, 0]]))[0, 1] - CAMERA.project(np.zeros((1, 3)))[0, 1]
    )
    expected = [0 * x, sign * scale + 0 * x, sign * scale * x, 0 * x, shape.normals[:, 1]]
    np.testing.assert_allclose(shape.across, expected, atol=2e-3)
    assert shape.tip_along[0] == pytest.approx(scale, rel=1e-6)
    assert shape.tip_along[3] == pytest.approx(1.0, rel=1e-6)


def test_changes_with_the_force_agree_with_the_closed_form() -> None:
    """Fix the arc length, change the force: the lever follows from s_c."""

    def line(force: float, x: Floats) -> Floats:
        q = force / BEAM.flexural_rigidity
        lever = brentq(lambda value: contact_at(q, value)[3][0] - LOAD.s, 0.05, LOAD.s)
        return exact_line(q, lever, x)

    shape = shape_of(imaged(), ["normal_force"])
    beam = imaged().pixels
    before = shape.pixels[:, 0] < 0.5 * (beam[0, 0] + beam[-1, 0])  # well before the contact
    points = (shape.pixels - 255.5) * 0.36 / 700  # about the camera's axis
    flip = np.sign(CAMERA.project(np.array([[0.12, 0.019, 0.0]]))[0, 1] - 255.5)
    x = points[before, 0] + 0.12
    step = 1e-4
    slope = (line(LOAD.normal_force + step, x) - line(LOAD.normal_force - step, x)) / (2 * step)
    # A change of y at the same x is this across the image.
    expected = flip * slope * shape.normals[before, 1] * 700 / 0.36
    np.testing.assert_allclose(shape.across[0, before], expected, rtol=2e-3, atol=0.02)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_derivatives_do_not_depend_on_the_step(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = shape_of(imaged(), PARAMETERS)
    monkeypatch.setattr(module, "STEP", factor * module.STEP)
    other = shape_of(imaged(), PARAMETERS)
    units = [imaged().unit(name) for name in PARAMETERS]
    for one, two, unit in zip(chosen.across, other.across, units, strict=True):
        # A direction in plane C hardly changes the image: 0.2 px per radian across it.
        np.testing.assert_allclose(one, two, atol=1e-4 * np.abs(one).max() + 1e-3 / unit)


def test_the_force_and_the_rigidity_are_one_parameter_of_the_image() -> None:
    shape = shape_of(imaged(), ["normal_force", "rigidity"])
    by_force, by_rigidity = shape.across
    ratio = -LOAD.normal_force / BEAM.flexural_rigidity
    np.testing.assert_allclose(by_rigidity, ratio * by_force, rtol=1e-4, atol=1e-3)


def test_a_beam_that_comes_nearer_looks_wider() -> None:
    beam = imaged(Load(0.14, 1e-9))
    shape = image_shape(beam, beam.neighbours(["clamp_z", "clamp_y", "fx"]))
    # The camera is 0.36 m above the beam; fx is a factor of the image.
    np.testing.assert_allclose(shape.wider[0], 1 / 0.36, rtol=1e-5)
    np.testing.assert_allclose(shape.wider[1], 0.0, atol=1e-9)
    np.testing.assert_allclose(shape.wider[2], 1 / beam.camera.fx, rtol=1e-5)


def steady(mean: Floats) -> Floats:
    """Noise with the same variance, 0.01, in all pixels."""
    return np.full_like(mean, 0.01)


def of_bar(visible: Floats) -> PlacesInformation:
    return PlacesInformation(visible[:, None, None] * information(BAR, steady))


def test_a_straight_line_has_the_information_of_linear_regression() -> None:
    shape = shape_of(imaged(Load(0.14, 1e-9)), ["clamp_y", "motor_angle"])
    total = image_information(shape, of_bar(np.ones(200)))
    per_metre = information(BAR, steady)[SHIFT, SHIFT] * SCALE
    # The integrals of 1, x and x^2 over the length, times the squared scale.
    integrals = np.array([[0.24, 0.24**2 / 2], [0.24**2 / 2, 0.24**3 / 3]])
    np.testing.assert_allclose(total.matrix[:2, :2], SCALE**2 * per_metre * integrals, rtol=1e-4)


def test_hidden_places_inform_on_nothing() -> None:
    shape = shape_of(imaged(), ["s_c", "normal_force"])
    half = (np.arange(200) < 100).astype(float)
    parts = [
        image_information(shape, of_bar(visible)) for visible in (half, 1 - half, np.ones(200))
    ]
    np.testing.assert_allclose(parts[0].matrix + parts[1].matrix, parts[2].matrix, rtol=1e-12)
    assert np.linalg.eigvalsh(parts[0].matrix[:2, :2]).min() > 0


def test_an_image_informs_on_force_over_rigidity_only() -> None:
    names = ["s_c", "normal_force", "rigidity"]
    shape = shape_of(imaged(), names)
    total = image_information(shape, of_bar(np.ones(200)))
    beam = imaged()
    unit = np.array([beam.unit(name) for name in names])
    relative = total.matrix[:3, :3] * np.outer(unit, unit)
    together = np.array([0.0, 1.0, 1.0])  # force and rigidity larger by the same factor
    assert together @ relative @ together < 1e-6 * relative[1, 1]
