import tracemalloc

import numpy as np
import pytest

from solver.centreline.noise import estimate_noise
from solver.instrument.arrays import Floats
from tests.beam_images import Look, Sensor, bent, drawn, guide
from tests.draws import generator

SENSOR = Sensor()
PER_GRAY = 255 / SENSOR.full_well
DARK = (SENSOR.read_noise * PER_GRAY) ** 2 + 1 / 12


def wedge(edges: bool) -> Floats:
    """From dark to bright (200, 300); with `edges`, squares of another brightness on it."""
    light = np.tile(np.linspace(0.04, 0.9, 300), (200, 1))
    if edges:
        light[40:80, 30:270] *= 0.6
        light[120:124] *= 0.3
    return light


@pytest.mark.parametrize("images", [2, 4])
def test_several_images_give_the_photon_transfer_line(
    images: int, random: np.random.Generator
) -> None:
    light = wedge(edges=True)
    noise = [estimate_noise([SENSOR(light, random) for _ in range(images)]) for _ in range(3)]
    assert np.mean([one.per_gray for one in noise]) == pytest.approx(PER_GRAY, rel=0.05)
    for gray, relative in ((128.0, 0.03), (12.0, 0.1)):
        mean = np.mean([one.variance(gray) for one in noise])
        assert mean == pytest.approx(DARK + PER_GRAY * gray, rel=relative)


@pytest.mark.parametrize("edges", [False, True])
def test_one_image_gives_it_too(edges: bool, random: np.random.Generator) -> None:
    """Where rounding and edges add to it, the variance is too large, by up to a sixth."""
    light = wedge(edges)
    noise = [estimate_noise([SENSOR(light, random)]) for _ in range(16)]
    for gray in (20.0, 100.0, 200.0):
        mean = np.mean([one.variance(gray) for one in noise]) / (DARK + PER_GRAY * gray)
        assert 0.98 < mean < 1.2  # each has a standard deviation of 0.01 to 0.03


@pytest.mark.parametrize("full_well", [500, 10_000])
def test_one_image_of_an_even_scene_gives_its_noise(
    full_well: int, random: np.random.Generator
) -> None:
    """Its gray values differ by their noise alone, which says nothing about their level."""
    sensor = Sensor(full_well=full_well)
    variance = estimate_noise([sensor(np.full((128, 320), 0.3), random)]).variance(0.3 * 255)
    # Rounding to whole gray values adds 7 %; each has a standard deviation of 0.01.
    assert variance / sensor.sigma(0.3) ** 2 == pytest.approx(1.03, abs=0.07)


def test_a_deep_image_has_the_noise_of_its_own_unit(random: np.random.Generator) -> None:
    deep = Sensor(bits=16)
    noise = estimate_noise([deep(wedge(edges=False), random) for _ in range(3)])
    assert noise.per_gray == pytest.approx(65535 / deep.full_well, rel=0.05)


@pytest.mark.parametrize("gray", [0, 255])
def test_an_even_image_has_rounding_s_noise(gray: int) -> None:
    even = np.full((40, 60), gray, np.uint8)
    for images in ([even], [even, even]):
        assert estimate_noise(images).variance(float(gray)) == pytest.approx(1 / 12)


def test_flicker_is_no_noise(random: np.random.Generator) -> None:
    gains = (1.0, 1.03, 0.985, 1.015)
    noise = estimate_noise([SENSOR(gain * wedge(edges=True), random) for gain in gains])
    for gray in (20.0, 128.0, 220.0):
        assert noise.variance(gray) == pytest.approx(DARK + PER_GRAY * gray, rel=0.1)


def test_one_image_of_a_thin_bright_beam_gives_its_shot_noise() -> None:
    light = drawn(guide(), bent(0.0, tilt=3e-3), Look())
    slopes = [estimate_noise([SENSOR(light, generator(__name__, n))]).per_gray for n in range(5)]
    # Where a beam along the rows makes every column an edge, the smaller of two deviations is
    # always the same one, and its square 2.6 times that of white noise in both.
    assert min(slopes) > 0.7 * PER_GRAY
    assert max(slopes) < 2.6 * PER_GRAY


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
def test_noise_is_never_negative(random: np.random.Generator) -> None:
    """Read noise alone, and a scatter that falls with the gray value, as processing leaves it."""
    for exponent in (0.0, -1.0, 1.0):
        light = wedge(edges=False)
        gray = [255 * light + light**exponent * random.standard_normal(light.shape) for _ in (1, 2)]
        images = [np.clip(np.rint(one), 0, 255).astype(np.uint8) for one in gray]
        for several in (images[:1], images):
            noise = estimate_noise(several)
            darkest = float(np.mean(several, axis=0).min())
            assert noise.dark + noise.per_gray * darkest >= -1e-12
            assert noise.per_gray >= 0


def test_memory_does_not_grow_with_the_number_of_images(random: np.random.Generator) -> None:
    images = [random.integers(90, 110, (500, 800), dtype=np.uint8) for _ in range(12)]
    peaks = []
    for used in (3, 12):
        tracemalloc.start()
        estimate_noise(images[:used])
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # One of them as floats has 3.2 MB.
    assert peaks[1] < peaks[0] + 1e6
