from collections.abc import Callable

import cv2
import numpy as np
import pytest

from solver.centreline.noise import estimate_noise
from solver.centreline.pixel_grid import grid_period
from solver.instrument.arrays import Grey
from tests.beam_images import Sensor

Process = Callable[[Grey], Grey]
SENSOR = Sensor()


def resized(factor: float, interpolation: int) -> Process:
    return lambda image: np.asarray(
        cv2.resize(image, None, fx=factor, fy=factor, interpolation=interpolation)
    )


def through_mosaic(image: Grey) -> Grey:
    colours = cv2.cvtColor(image, cv2.COLOR_BAYER_RGGB2BGR)
    return np.asarray(cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY))


def compressed(image: Grey) -> Grey:
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))


def blurred(image: Grey) -> Grey:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 0.8))


def period_of(process: Process, random: np.random.Generator, images: int = 4) -> int:
    light = np.tile(np.linspace(0.1, 0.5, 480), (180, 1))
    light[80:84] = 0.9
    processed = [process(SENSOR(light, random)) for _ in range(images)]
    return grid_period(processed, estimate_noise(processed))


@pytest.mark.parametrize(
    ("process", "period"),
    [
        (through_mosaic, 2),
        (resized(1.5, cv2.INTER_CUBIC), 3),
        (resized(0.75, cv2.INTER_AREA), 3),
        (resized(1.25, cv2.INTER_LINEAR), 5),
        (compressed, 8),
        (blurred, 1),
        (np.asarray, 0),
    ],
)
def test_the_noise_shows_the_grid_of_processing(
    process: Process, period: int, random: np.random.Generator
) -> None:
    assert period_of(process, random) == period


def test_a_single_image_shows_no_grid(random: np.random.Generator) -> None:
    assert period_of(through_mosaic, random, images=1) == 0
    assert period_of(through_mosaic, random, images=2) == 2


def test_flicker_and_a_shadow_are_no_processing(random: np.random.Generator) -> None:
    light = np.full((180, 480), 0.4)
    images = []
    for k in range(4):
        shaded = light * (1 + 0.02 * k)
        images.append(SENSOR(shaded, random))
    assert grid_period(images, estimate_noise(images)) == 0
