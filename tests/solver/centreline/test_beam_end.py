"""The fit of the free end in drawn images: its error, its sigma, and what the pixels allow."""

import numpy as np
import pytest

from solver.centreline.extractor import BeamExtractor, learn_profile_fit
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
