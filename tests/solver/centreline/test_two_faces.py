"""A flat strip whose two faces change their brightness and width: drawn by other means."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import ndtri

from solver.centreline.extractor import BeamExtractor, learn_profile_fit
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise
from solver.centreline.stations import Stations, stations
from solver.centreline.two_faces import Faces, fit_faces
from solver.instrument.arrays import Floats, Grey
from tests.beam_images import HEIGHT, WIDTH, Sensor, bent, distances, guide
from tests.draws import generator

TILT = 0.02
GROUND = 0.1
SUBPIXELS = 16
# Thickness and breadth [px] of the strip, and the angle of its thickness to the image at rest.
THICKNESS, BREADTH, ANGLE = 2.5, 12.0, 0.5
SENSOR = Sensor()


def strip_guide() -> Guide:
    seen = guide()
    return replace(seen, radius=THICKNESS / 2 * seen.pixel, strip_psi=ANGLE)


def drawn(
    theta: float, angle: float, levels: tuple[float, float], ridge_after: bool
) -> tuple[Floats, Floats]:
    """Light (height, width) of a strip bent by `theta`, and the pixels (n, 2) of its middle.

    `levels` are those of the wide and of the narrow face, which is on the side of larger rows
    where `ridge_after`.
    """
    pixels = guide().pixels(bent(theta, tilt=TILT))
    columns = np.arange(WIDTH)
    fine = (np.arange(HEIGHT * SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    u, v = pixels[np.argsort(pixels[:, 0])].T
    centre, slope = np.interp(columns, u, v), np.interp(columns, u, np.gradient(v, u))
    across = (fine[:, None] - centre) / np.hypot(1, slope) * (1 if ridge_after else -1)
    wide, narrow = BREADTH * np.sin(angle), THICKNESS * np.cos(angle)
    ridge = (wide - narrow) / 2
    on_strip = np.abs(across) < (wide + narrow) / 2
    light = np.where(on_strip, np.where(across < ridge, *levels), GROUND)
    light = np.where((columns >= u[0]) & (columns <= u[-1]), light, GROUND)
    return light.reshape(HEIGHT, SUBPIXELS, WIDTH).mean(axis=1), pixels


@cache
def learned(ridge_after: bool) -> BeamExtractor:
    light, _ = drawn(0.0, ANGLE, (0.4, 0.8), ridge_after)
    images = [SENSOR(light, generator(__name__, k)) for k in range(4)]
    return learn_profile_fit(images, strip_guide())


@pytest.mark.parametrize("ridge_after", [True, False])
def test_light_and_view_of_the_faces_do_not_move_the_centreline(ridge_after: bool) -> None:
    beam = learned(ridge_after)
    assert beam.appearance.faces is not None
    light, pixels = drawn(0.15, ANGLE - 0.05, (0.36, 0.84), ridge_after)
    image = SENSOR(light, generator(__name__, 9))
    one_profile = replace(beam, appearance=replace(beam.appearance, faces=None))
    errors = []
    for extract in (beam, one_profile):
        line = extract(image)
        assert len(line.points) > 0.8 * np.ptp(pixels[:, 0])
        off = distances(line.points, pixels)
        errors.append(float(np.median(off)))
        if extract is beam:
            # The drawing's subpixels and the ridge's sharpness leave a few hundredths of a pixel.
            assert np.sqrt(np.mean((off / line.sigma) ** 2)) < 1.5
    assert abs(errors[0]) < 0.015
    assert abs(errors[1]) > 5 * abs(errors[0])


@pytest.mark.parametrize("seed", range(3))
def test_sigmas_are_those_of_the_noise(seed: int) -> None:
    beam = learned(True)
    light, pixels = drawn(0.1, ANGLE, (0.4, 0.8), True)
    line = beam(SENSOR(light, generator(__name__, 20 + seed)))
    z = distances(line.points, pixels) / line.sigma
    # Of 250 columns, five standard errors of a scatter are 22 %.
    assert 0.75 < np.std(z) < 1.2


def test_a_strip_that_looks_like_a_line_has_no_faces() -> None:
    seen = replace(strip_guide(), radius=0.5 * guide().pixel)
    pixels = guide().pixels(bent(0.0, tilt=TILT))
    columns = np.arange(WIDTH)
    fine = (np.arange(HEIGHT * SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    centre = np.interp(columns, *pixels[np.argsort(pixels[:, 0])].T)
    light = np.where(np.abs(fine[:, None] - centre) < 1.0, 0.7, GROUND)
    light[:, columns > pixels[:, 0].max()] = GROUND
    light = light.reshape(HEIGHT, SUBPIXELS, WIDTH).mean(axis=1)
    images = [SENSOR(light, generator(__name__, 40 + k)) for k in range(2)]
    assert learn_profile_fit(images, seen).appearance.faces is None


def column(centre: float, width: float, levels: tuple[float, float], blur: float) -> Grey:
    """One column (41, 1) of a strip on black: an independent drawing, by fine sums."""
    fine = (np.arange(41 * 400) + 0.5) / 400 - 0.5
    ridge = 2.0 + 0.6 * (width - 10.0)
    across = fine[:, None] - centre
    # A normal distribution as 200 equally likely shifts.
    quantiles = (np.arange(200) + 0.5) / 200
    shifted = across - blur * ndtri(quantiles)
    inside = np.abs(shifted) < width / 2
    light = np.where(inside, np.where(shifted < ridge, *levels), 10.0).mean(axis=1)
    return np.asarray(np.rint(light.reshape(41, 400).mean(axis=1) * 250), np.uint16)[:, None]


def one_station(start: float) -> Stations:
    return stations(np.array([[-0.4, start], [0.4, start]]), (41, 1))


@pytest.mark.parametrize(
    ("centre", "width", "levels"),
    [(20.3, 10.0, (60.0, 120.0)), (19.6, 11.0, (60.0, 80.0)), (20.0, 9.0, (100.0, 50.0))],
)
def test_edges_and_faces_of_a_column_are_found(
    centre: float, width: float, levels: tuple[float, float]
) -> None:
    faces = Faces(10.0, 2.0, 0.6, 0.6, np.full(2, 2e4))
    image = column(centre, width, levels, 0.6)
    found = fit_faces(image, one_station(20.0), faces, Noise(1.0, 0.0), 14, 65535)
    np.testing.assert_allclose(found.fits.centre, centre, atol=2e-3)
    np.testing.assert_allclose(found.width, width, atol=4e-3)
    ridge = 2.0 + 0.6 * (width - 10.0)
    light = (width / 2 + ridge) * (levels[0] - 10) + (width / 2 - ridge) * (levels[1] - 10)
    np.testing.assert_allclose(found.fits.amplitude, 250 * light, rtol=2e-3)


def test_a_column_at_full_scale_is_left_out() -> None:
    faces = Faces(10.0, 2.0, 0.6, 0.6, np.full(2, 2e4))
    image = column(20.0, 10.0, (60.0, 120.0), 0.6)
    found = fit_faces(image, one_station(20.0), faces, Noise(1.0, 0.0), 14, 1)
    assert not np.isfinite(found.fits.sigma[0])
    assert found.fits.saturated[0] == 29
