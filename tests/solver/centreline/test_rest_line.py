"""Detection of the beam at rest by its mean contrast along lines."""

from dataclasses import replace

import numpy as np
import pytest

from solver.centreline.rest_line import find_rest_line
from solver.instrument.arrays import Floats
from tests.beam_images import HEIGHT, WIDTH, Look, bent, drawn, guide
from tests.draws import generator
from tests.solver.centreline.test_ground import felt

THIN = Look(beam=0.5, ground=0.4, radius_px=0.4, spread_px=0.4)


def image(noise: float, tilt: float = 0.0, look: Look = THIN) -> Floats:
    light = drawn(guide(), bent(0.0, tilt=tilt), look)
    return 255 * light + noise * generator(__name__, 1).standard_normal(light.shape)


@pytest.mark.parametrize("polarity", [1, -1])
@pytest.mark.parametrize("tilt", [-0.09, 0.0, 0.05])
def test_a_beam_below_the_noise_of_a_column_is_found(polarity: int, tilt: float) -> None:
    """A bright beam's contrast is half of a pixel's sigma: no column shows it, 280 of them do."""
    look = THIN if polarity == 1 else Look(0.3, 0.4, THIN.radius_px, THIN.spread_px)
    line = find_rest_line(image(6.0, tilt, look), guide(), (1, 2))
    assert line is not None
    assert line.polarity == polarity
    x, y = line.places.T
    assert np.abs(y - np.tan(tilt) * x).max() < 1.5 * guide().pixel


@pytest.mark.parametrize("seed", range(8))
def test_a_texture_alone_shows_no_beam(seed: int) -> None:
    assert find_rest_line(255 * felt(seed), guide(), (1, 2)) is None


@pytest.mark.parametrize("seed", range(3))
def test_a_thin_beam_is_found_on_a_texture_of_its_brightness(seed: int) -> None:
    """Of a beam of 0.7 px, whose contrast is half of the texture's scatter, mean values show none.

    The texture's gray values are alike over five pixels.
    """
    thin = replace(guide(), radius=0.35 * guide().pixel)
    look = Look(beam=0.2, ground=0.12, radius_px=0.35, spread_px=0.4)
    light = drawn(guide(), bent(0.0, tilt=0.05), look, felt(seed, correlation=5.0))
    noise = generator(__name__, seed).standard_normal(light.shape)
    line = find_rest_line(255 * light + noise, thin, (1, 2))
    assert line is not None
    assert (line.polarity, line.width) == (1, 1)
    x, y = line.places.T
    assert np.abs(y - np.tan(0.05) * x).max() < 0.5 * thin.pixel


@pytest.mark.parametrize("correlation", [1.0, 5.0, 10.0])
def test_no_texture_matches_a_beam(correlation: float) -> None:
    thin = replace(guide(), radius=0.35 * guide().pixel)
    for seed in range(2):
        assert find_rest_line(255 * felt(seed, correlation), thin, (1, 2)) is None


def test_noise_alone_shows_no_beam(random: np.random.Generator) -> None:
    noise = random.standard_normal((HEIGHT, WIDTH))
    assert find_rest_line(100 + noise, guide(), (1, 2)) is None
    assert find_rest_line(np.full((HEIGHT, WIDTH), 100.0), guide(), (1, 2)) is None


def test_a_bowed_beam_is_followed() -> None:
    """A bow of five pixels is within the lines that are tried."""
    v = np.arange(HEIGHT)[:, None]
    (u0, v0), (u1, v1) = guide().ends
    along = np.clip((np.arange(WIDTH) - u0) / (u1 - u0), 0, 1)
    course = v0 + (v1 - v0) * along - 5 * 4 * along * (1 - along)
    light = 40 + 60 * np.exp(-(((v - course) / 0.8) ** 2))
    line = find_rest_line(light, guide(), (1, 2))
    assert line is not None
    pixels = guide().pixels(line.places)
    inside = (pixels[:, 0] > u0 + 5) & (pixels[:, 0] < u1 - 5)
    expected = np.interp(pixels[inside, 0], np.arange(WIDTH), course)
    assert np.abs(pixels[inside, 1] - expected).max() < 1.0
