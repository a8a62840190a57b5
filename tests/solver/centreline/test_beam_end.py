"""The fit of the free end in drawn images: its error, its sigma, and what the pixels allow."""

import numpy as np
import pytest

from solver.centreline.beam_end import MEAN_BULGE, BeamEnd, Light, StraightBeam, fit_end
from solver.centreline.extractor import BeamExtractor, learn_profile_fit
from solver.centreline.noise import Noise
from solver.centreline.profile import STEP
from solver.instrument.arrays import Floats
from tests.beam_images import METRES_PER_PIXEL, bent, drawn, guide, longer
from tests.draws import generator
from tests.solver.centreline.test_beam import BRIGHT, SENSOR, TILT, UP, learned, seen
from tests.solver.centreline.test_ground import felt


def off_along(beam: BeamExtractor, light: Floats, shape: Floats, roll: float, seed: int) -> Floats:
    """The tip's error along a beam of this shape (n, 2) [m], and its sigma: (2,) [px]."""
    pixels, line = guide(roll).pixels(shape), seen(light, beam, seed)
    assert line.tip is not None
    assert line.tip_covariance is not None
    along = (pixels[-1] - pixels[-20]) / np.hypot(*(pixels[-1] - pixels[-20]))
    sigma = float(np.sqrt(along @ line.tip_covariance @ along))
    return np.array([float((line.tip - pixels[-1]) @ along), sigma])


def least_sigma(theta: float, length: float, roll: float) -> float:
    """The limit [px] of a tip's sigma, where all of the image but the tip is known."""
    step = 0.05 * METRES_PER_PIXEL
    before, after = (
        255 * drawn(guide(roll), longer(bent(theta, 0.6, TILT), length + sign * step), BRIGHT)
        for sign in (-1, 1)
    )
    slope = (after - before) / 0.1
    sigma = np.vectorize(SENSOR.sigma)((before + after) / 2 / 255)
    return float(1 / np.sqrt((slope**2 / sigma**2).sum()))


@pytest.mark.parametrize(
    ("theta", "roll"), [(0.2, 0.0), pytest.param(-0.1, UP, marks=pytest.mark.thorough)]
)
def test_the_end_is_nearly_as_precise_as_its_pixels_allow(theta: float, roll: float) -> None:
    beam, found, limits = learned(BRIGHT, roll), [], []
    for part in (0.1, 0.4, 0.8):
        shape = longer(bent(theta, 0.6, TILT), part * METRES_PER_PIXEL)
        light = drawn(guide(roll), shape, BRIGHT)
        found += [off_along(beam, light, shape, roll, seed) for seed in range(6)]
        limits.append(least_sigma(theta, part * METRES_PER_PIXEL, roll))
    off, sigma = np.array(found).T
    limit = float(np.sqrt(np.mean(np.square(limits))))
    assert np.sqrt(np.mean(off**2)) < 2 * limit
    assert 0.7 < np.sqrt(np.mean(sigma**2) / np.mean(off**2)) < 2.6


def test_the_end_of_a_beam_that_is_longer_than_stated_is_no_structure_of_the_ground() -> None:
    for seed in range(2):
        ground, random = felt(seed, correlation=6.0), generator(__name__, seed)
        shape = longer(bent(0.0, 0.6, TILT), 1.5 * METRES_PER_PIXEL)
        light = drawn(guide(), shape, BRIGHT, ground)
        images = [SENSOR(light, random) for _ in range(4)]
        beam = learn_profile_fit(images, guide())
        assert beam.appearance.ground_at_rest is not None
        line = beam(images[0])
        assert line.tip is not None
        assert line.tip_covariance is not None
        off = line.tip[0] - guide().pixels(shape)[-1, 0]
        assert abs(off) < 0.3
        assert abs(off) < 4 * np.sqrt(line.tip_covariance[0, 0])


def test_the_end_in_a_sharp_image_does_not_depend_on_its_place_in_the_pixel() -> None:
    radius, bulge, fine = 0.8, 0.25, 64
    across = np.arange(-200, 201) * STEP
    shape = np.sqrt(np.maximum(1 - (across / radius) ** 2, 0.0))
    end = BeamEnd(shape / (shape.sum() * STEP), 0.0, radius, bulge)
    # Places in the pixels of ten rows and twenty columns, and the axis 0.1 px beside a pixel's.
    v, u = (np.arange(n * fine) / fine + 0.5 / fine - 0.5 for n in (10, 20))
    beside = v[:, None] - 5.1
    outline = np.sqrt(np.maximum(1 - (beside / radius) ** 2, 0.0))
    light = np.interp(beside, across, end.brightness, left=0.0, right=0.0)
    line = StraightBeam(0.0, 5.1, 1.0, True)
    for place in 9.5 + np.linspace(-0.2, 0.2, 17):
        covered = np.clip((place + bulge * (outline - MEAN_BULGE) - u) * fine + 0.5, 0.0, 1.0)
        image = 10 + 200 * (light * covered).reshape(10, fine, 20, fine).mean(axis=(1, 3))
        fit = fit_end(
            image, line, end, float(place) - 0.15, Light(200.0, 0.5, 10.0), Noise(1.0, 0.0), 4095
        )
        assert abs(fit.along - place) < 0.003
