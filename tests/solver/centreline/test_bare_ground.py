"""The ground as images without the beam show it."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from solver.centreline.bare_ground import BareGround, bare_ground, match, shifted, structured
from solver.centreline.extractor import BeamExtractor, learn_profile_fit
from solver.centreline.ground import learn_ground
from solver.centreline.noise import estimate_noise
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from tests.beam_images import (
    HEIGHT,
    METRES_PER_PIXEL,
    WIDTH,
    Look,
    Sensor,
    bent,
    distances,
    drawn,
    guide,
)
from tests.draws import generator

TILT = 0.012
SENSOR = Sensor()
LOOK = Look(beam=0.6, roundness=1.0, spread_px=0.4)
N_IMAGES = 4


def felt(seed: int, du: float = 0.0, dv: float = 0.0) -> Floats:
    """A ground (height, width) of waves 5 px long and more, moved by (du, dv) [px]."""
    random = generator(__name__, seed)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    waves = np.zeros((HEIGHT, WIDTH))
    for _ in range(60):
        k, angle, phase = random.uniform(0.3, 2 * np.pi / 5), *random.uniform(0, 2 * np.pi, 2)
        waves += np.cos(k * (np.cos(angle) * (u - du) + np.sin(angle) * (v - dv)) + phase)
    return np.asarray(0.25 * np.clip(1 + 0.4 * waves / waves.std(), 0.1, 3))


def images(light: Floats, seed: int, count: int = N_IMAGES) -> list[Grey]:
    random = generator(__name__, seed)
    return [SENSOR(light, random) for _ in range(count)]


def rest_images(seed: int, light: float = 1.0) -> list[Grey]:
    return images(light * drawn(guide(), bent(0.0, tilt=TILT), LOOK, felt(seed)), seed + 100)


@cache
def bare(seed: int, du: float = 0.0, dv: float = 0.0) -> BareGround:
    ground = bare_ground(images(felt(seed, du, dv), seed + 200))
    assert ground is not None
    return ground


def learned(seed: int, ground: BareGround | None, light: float = 1.0) -> BeamExtractor:
    return learn_profile_fit(rest_images(seed, light), replace(guide(), bare_ground=ground))


def pushed(seed: int, du: float = 0.0, dv: float = 0.0) -> tuple[Grey, Floats]:
    """An image of a pushed beam before a ground that has moved, and its pixels (n, 2)."""
    shape = bent(0.15, 0.6, TILT)
    (image,) = images(drawn(guide(), shape, LOOK, felt(seed, du, dv)), seed + 300, 1)
    return image, guide().pixels(shape)


def test_copies_of_an_image_count_once() -> None:
    one, other = images(felt(0), 1, 2)
    ground = bare_ground([one, other, one])
    assert ground is not None
    assert ground.images == 2
    np.testing.assert_allclose(ground.gray, (one.astype(float) + other) / 2)
    assert bare_ground([]) is None


@pytest.mark.parametrize("shift", [(0.3, -0.7), (1.4, 0.0), (-0.5, 1.9)])
def test_gray_values_are_shifted(shift: tuple[float, float]) -> None:
    gray = np.asarray(255 * felt(3), np.float32)
    there = shifted(gray, np.array(shift))
    inside = slice(8, -8)
    error = (there - 255 * felt(3, *shift))[inside, inside]
    assert np.sqrt(np.mean(error**2)) < 0.02 * gray.std()


@pytest.mark.parametrize(("light", "shift"), [(1.0, (0.0, 0.0)), (0.8, (0.4, -1.2))])
def test_light_and_shift_are_measured(light: float, shift: tuple[float, float]) -> None:
    ground = bare(4)
    (image,) = images(light * felt(4, *shift), 5, 1)
    noise = estimate_noise([image])
    found = match(image, ground.gray, structured(ground.gray, noise), noise, 1 / ground.images)
    assert found is not None
    assert abs(found.gain / light - 1) < 0.005
    assert (np.abs(found.shift - shift) < 5 * found.sigma + 0.01).all()
    assert found.scatter < 1.5
    assert found.is_shifted == any(shift)


def test_a_ground_without_structure_is_not_needed() -> None:
    light = drawn(guide(), bent(0.0, tilt=TILT), LOOK, np.full((HEIGHT, WIDTH), 0.2))
    even = bare_ground(images(np.full((HEIGHT, WIDTH), 0.2), 6))
    rests = images(light, 7)
    beam = learn_profile_fit(rests, replace(guide(), bare_ground=even))
    look, plain = beam.appearance, learn_profile_fit(rests, guide())
    assert look.bare_ground is not None
    assert look.bare_ground.images == N_IMAGES
    assert not look.bare_ground.problem
    assert np.array_equal(beam(rests[0]).points, plain(rests[0]).points)


def test_another_ground_is_not_used() -> None:
    """As after a push against the camera's stand."""
    for other in (bare(8), bare(0, 5.0, 3.0)):
        beam, without = learned(0, other), learned(0, None)
        look = beam.appearance
        assert look.bare_ground is not None
        assert "do not show the ground of the rest images" in look.bare_ground.problem
        image, _ = pushed(0)
        assert np.array_equal(beam(image).points, without(image).points)


def test_images_with_the_beam_are_refused() -> None:
    with pytest.raises(InputError, match="images in ground/ show the beam where it is at rest"):
        learned(0, bare_ground(rest_images(0, 1.01)))


@pytest.mark.thorough
def test_a_known_ground_makes_the_points_accurate() -> None:
    """Whatever has moved and however the light has changed between the three sets of images."""
    scatter, in_sigmas, over_interpolated = [], [], []
    for seed in range(6):
        image, pixels = pushed(seed, 0.2 * (seed % 3), -0.1 * seed)
        ground = bare(seed, 0.3 * (seed % 2), 0.2 * (seed % 3))
        line = learned(seed, ground, 1.0 if seed % 2 else 0.9)(image)
        assert len(line.points) > 0.7 * np.ptp(pixels[:, 0])
        error = distances(line.points, pixels)
        scatter.append(np.sqrt(np.median(error**2)))
        in_sigmas.append(1.4826 * np.median(np.abs(error / line.sigma)))
        plain = distances(learned(seed, None)(image).points, pixels)
        over_interpolated.append(scatter[-1] / np.median(np.abs(plain)))
    # 1.0 to 1.3, and a fifth to a half.
    assert 0.7 < np.median(in_sigmas) < 1.5
    assert np.median(over_interpolated) < 0.7


def test_a_beam_hides_as_much_with_its_flanks_as_with_its_middle() -> None:
    """Of a shaded beam, the flanks are dark and the middle is bright."""
    look = learned(0, bare(0)).appearance
    cover = look.profile.cover
    assert cover is not None
    assert abs(look.section.radius / LOOK.radius_px - 1) < 0.06
    half = cover.value.shape[-1] // 2
    assert cover.value[0, 0, half] < look.profile.value[0, 0, half]
    # A smooth ground is known under the beam as well.
    assert look.ground_at_rest is not None
    error = look.ground_at_rest.gray - 255 * felt(0)
    assert np.sqrt(np.mean(error**2)) < 1.5 * np.sqrt(np.median(look.ground_at_rest.variance))


def test_a_beam_within_one_pixel_has_no_centre_there() -> None:
    """Half a pixel wide and not blurred, it has none in half of the columns."""
    thin = Look(roundness=1.0, spread_px=0.0, radius_px=0.25)
    narrow = replace(guide(), radius=thin.radius_px * METRES_PER_PIXEL)
    for seed in range(3):
        light = drawn(guide(), bent(0.0, tilt=0.004), thin, felt(seed))
        before = replace(narrow, bare_ground=bare(seed))
        errors = learn_profile_fit(images(light, 11), before).appearance.ground_errors
        assert errors.whole > 0
        assert errors.smooth >= 0


def test_errors_are_as_long_as_the_grain() -> None:
    """What is within a pixel is as long as the grain: neighbours share it."""
    lengths = []
    for along in (1.0, 12.0):
        white = generator(__name__, 9).standard_normal((HEIGHT, WIDTH))
        waves = cv2.GaussianBlur(white, (0, 0), sigmaX=along, sigmaY=1.0)
        light = 0.25 * np.maximum(1 + 0.4 * waves / waves.std(), 0.1)
        rests = images(light, 10)
        path, noise = guide().pixels(bent(0.0, tilt=TILT)), estimate_noise(rests)
        ground = learn_ground(rests, path, 2.5, noise, 7, bare_ground(rests))
        assert ground is not None
        assert ground.bare_images == N_IMAGES
        assert ground.fine > 0
        lengths.append(ground.grain.smooth)
    # The integral of the correlation of noise that is blurred by a sigma is 3.5 sigma. The longer
    # one is cut by the image's border.
    assert 0.7 * 3.5 < lengths[0] < 1.4 * 3.5
    assert 0.5 * 42 < lengths[1] < 1.2 * 42


def test_the_mean_of_texture_blurs_with_a_shift_that_is_not_removed() -> None:
    """A frame whose camera has moved shows the ground elsewhere: it is followed."""
    beam = learned(1, bare(1))
    ground = beam.appearance.ground_at_rest
    assert ground is not None
    still, _ = pushed(1)
    assert ground.in_image(still, beam.appearance.noise) is ground
    moved, _ = pushed(1, 0.6, -0.3)
    there = ground.in_image(moved, beam.appearance.noise)
    truth = 255 * felt(1, 0.6, -0.3)
    inside = slice(10, -10)
    before, after = (np.std((each.gray - truth)[inside, inside]) for each in (ground, there))
    assert after < 0.3 * before
    assert cv2.mean(there.gray)[0] == pytest.approx(cv2.mean(ground.gray)[0], rel=0.01)
