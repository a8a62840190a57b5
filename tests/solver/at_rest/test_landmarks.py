"""A camera that was knocked, in scenes drawn in numpy: a dark hub on a textured ground."""

from functools import cache

import cv2
import numpy as np
import pytest
from scipy.special import ndtr

from solver.at_rest.landmarks import ImageShift, Landmarks, learn_landmarks, with_prior
from solver.at_rest.thresholds import THRESHOLDS
from solver.centreline.noise import estimate_noise
from solver.instrument.arrays import Floats, Grey
from tests.beam_images import Sensor
from tests.consistency import MOST_SIGMAS
from tests.draws import generator

HEIGHT, WIDTH = 100, 140
SENSOR = Sensor()
BEAM = np.array([[30.0, 50.0], [150.0, 50.0]])


def scene(du: float = 0.0, dv: float = 0.0, texture: float = 0.06) -> Floats:
    """Light (height, width) of a hub and waves on the ground, shifted by (du, dv) [px]."""
    v, u = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    u, v = u - du, v - dv
    random = generator(__name__, 8)
    ground = np.full(u.shape, 0.4)
    for _ in range(12):
        angle, waves, phase = (
            random.uniform(0, 2 * np.pi),
            random.uniform(0.2, 0.7),
            6 * random.uniform(),
        )
        ground += texture / 3 * np.cos(waves * (u * np.cos(angle) + v * np.sin(angle)) + phase)
    hub = ndtr((18 - np.hypot(u - 35, v - 50)) / 0.8)
    return np.asarray(ground * (1 - hub) + 0.08 * hub)


def image(light: Floats, seed: int) -> Grey:
    return SENSOR(light, generator(__name__, seed))


def compressed(picture: Grey, quality: int) -> Grey:
    """As JPEG, and back."""
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8)


@cache
def landmarks() -> Landmarks:
    rests = [image(scene(), seed) for seed in range(4)]
    return learn_landmarks(rests, BEAM, 8.0, estimate_noise(rests))


def shift_of(light: Floats, seed: int = 100) -> ImageShift:
    shift = landmarks().shift_of(image(light, seed))
    assert shift is not None
    return shift


def chi2(shift: ImageShift, du: float, dv: float) -> float:
    error = shift.shift - [du, dv]
    return float(error @ np.linalg.solve(shift.covariance, error))


@pytest.mark.parametrize(("du", "dv"), [(0.5, 0.0), (0.0, 0.5), (2.0, -1.3), (5.0, 0.0)])
def test_a_shift_is_found_within_its_sigma(du: float, dv: float) -> None:
    shift = shift_of(scene(du, dv))
    # The interpolation between pixels errs by some thousandths.
    off = shift.shift - [du, dv]
    sigma = np.sqrt(np.diag(shift.covariance))
    assert (np.abs(off) < MOST_SIGMAS * sigma + 0.003).all()
    assert sigma.max() < 0.1
    assert shift.exceeds(0.0)


@pytest.mark.parametrize(("du", "dv"), [(0.3, -0.25), (-0.4, 0.1)])
def test_edges_sharper_than_a_pixel_show_a_shift(du: float, dv: float) -> None:
    """A hub on a plain ground through a perfect lens, as the mean of each pixel."""

    def light(du: float, dv: float) -> Floats:
        fine = 8
        v, u = (np.mgrid[: HEIGHT * fine, : WIDTH * fine] + 0.5) / fine - 0.5
        hub = np.hypot(u - du - 35, v - dv - 50) < 12
        parts = np.where(hub, 0.9, 0.08).reshape(HEIGHT, fine, WIDTH, fine)
        return np.asarray(parts.mean(axis=(1, 3)))

    rests = [image(light(0.0, 0.0), seed) for seed in range(4)]
    found = learn_landmarks(rests, BEAM, 8.0, estimate_noise(rests)).shift_of(
        image(light(du, dv), 9)
    )
    assert found is not None
    assert found.shift == pytest.approx((du, dv), abs=0.045)


@pytest.mark.thorough
def test_the_covariance_is_honest_and_noise_is_no_motion() -> None:
    """Over the noise of the rest images and of the image alike."""
    light, still, errors, exceeding = scene(), scene(0.3, -0.2), [], 0
    for seed in range(0, 2500, 5):
        rests = [image(light, seed + n) for n in range(2)]
        marks = learn_landmarks(rests, BEAM, 8.0, estimate_noise(rests))
        unmoved, moved = (marks.shift_of(image(one, seed + 3)) for one in (light, still))
        assert unmoved is not None
        assert moved is not None
        errors.append((chi2(unmoved, 0.0, 0.0), chi2(moved, 0.3, -0.2)))
        exceeding += unmoved.exceeds(0.0)
    # chi^2 of two degrees of freedom: 2 +- 0.09; the noise of two
    # rest images is estimated, and rather too large. Between pixels the interpolation adds some
    # thousandths of a pixel.
    of_unmoved, of_moved = np.mean(errors, axis=0)
    assert 1.2 < of_unmoved < 2.6
    assert 1.2 < of_moved < 4.0
    assert exceeding < 0.02 * len(errors)


def test_brighter_light_is_no_motion() -> None:
    shift = shift_of(1.4 * scene())
    assert np.hypot(*shift.shift) < 0.03
    assert not shift.exceeds(0.0)
    assert shift_of(1.4 * scene(0.5, 0.0)).exceeds(0.0)


def test_a_shadow_on_the_only_landmarks_is_no_motion() -> None:
    """The ground has no structure: all landmarks are on the hub's edge."""
    light = scene(texture=0.0)
    rests = [image(light, seed) for seed in range(4)]
    marks = learn_landmarks(rests, BEAM, 8.0, estimate_noise(rests))
    v = np.arange(HEIGHT)[:, None]
    shadow = 1 - 0.5 * ndtr((v - 50) / 20) * ndtr((70 - v) / 3)
    assert marks.shift_of(image(shadow * light, 9)) is None
    # A knocked camera is still detected, also under brighter light.
    moved = marks.shift_of(image(1.2 * scene(0.5, 0.0, texture=0.0), 9))
    assert moved is not None
    assert moved.exceeds(0.0)
    unmoved = marks.shift_of(image(1.2 * light, 9))
    assert unmoved is not None
    assert not unmoved.exceeds(0.0)


def test_landmarks_that_are_covered_say_nothing() -> None:
    hidden = scene()
    hidden[:, :90] = 0.5
    for light in (hidden, np.full((HEIGHT, WIDTH), 0.4)):
        assert landmarks().shift_of(image(light, 5)) is None


@pytest.mark.parametrize("degrees", [4.0, 15.0, 40.0])
def test_a_chequered_ground_that_turns_says_nothing(degrees: float) -> None:
    """The camera rides on the motor, and the ground turns below it."""

    def chequered(angle: float) -> Floats:
        v, u = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
        x = (u - 30) * np.cos(angle) + (v - 50) * np.sin(angle)
        y = (v - 50) * np.cos(angle) - (u - 30) * np.sin(angle)
        squares = np.tanh(4 * np.sin(np.pi * x / 12)) * np.tanh(4 * np.sin(np.pi * y / 12))
        return np.asarray(0.4 + 0.25 * squares)

    rests = [image(chequered(0.0), seed) for seed in range(2)]
    marks = learn_landmarks(rests, BEAM, 8.0, estimate_noise(rests))
    assert marks.known
    assert marks.shift_of(image(chequered(np.deg2rad(degrees)), 7)) is None


def test_an_even_scene_or_one_of_parallel_edges_has_no_landmarks() -> None:
    v = np.mgrid[:HEIGHT, :WIDTH][0]
    for light in (np.full((HEIGHT, WIDTH), 0.4), 0.4 + 0.2 * np.tanh((v - 75.0) / 2)):
        rests = [image(light, seed) for seed in range(2)]
        marks = learn_landmarks(rests, BEAM, 8.0, estimate_noise(rests))
        assert not marks.known
        assert marks.shift_of(rests[0]) is None


def test_what_compression_does_to_faint_edges_is_no_motion() -> None:
    """The rest images are one still picture; every frame is compressed by itself."""
    faint = 0.4 + 0.2 * (scene() - 0.4)
    rests = [compressed(image(faint, 0), 95)] * 4
    marks = learn_landmarks(rests, BEAM, 8.0, estimate_noise(rests))
    assert marks.processed
    shifts = [marks.shift_of(compressed(image(faint, seed), 50)) for seed in range(20)]
    assert sum(shift is not None and shift.exceeds(0.0) for shift in shifts) <= 1
    # Twice as far as three sigmas reach.
    far = marks.shift_of(compressed(image(0.4 + 0.2 * (scene(4.0, 0.0) - 0.4), 3), 50))
    assert far is not None
    assert far.exceeds(0.0)


def test_the_beam_itself_is_no_landmark() -> None:
    assert len(landmarks().pixels.rows) > 100
    near = (np.abs(landmarks().pixels.rows - 50) < 4) & (landmarks().pixels.columns > 30)
    assert not near.any()


def test_without_landmarks_the_prior_remains() -> None:
    shift, covariance = with_prior(None, 0.3)
    assert not shift.any()
    assert covariance == pytest.approx(np.eye(2) * 0.09)


def test_prior_and_measurement_are_weighted_by_their_variances() -> None:
    """Two normal variables along each axis (closed form)."""
    measured = ImageShift(np.array([0.4, -0.2]), np.diag([0.01, 0.04]))
    shift, covariance = with_prior(measured, 0.2)
    for axis, (value, variance) in enumerate(((0.4, 0.01), (-0.2, 0.04))):
        error = variance + THRESHOLDS.steadiness_px**2
        assert shift[axis] == pytest.approx(value * 0.04 / (0.04 + error))
        assert covariance[axis, axis] == pytest.approx(1 / (1 / 0.04 + 1 / error))


def test_drawn_shifts_are_as_far_off_as_stated(random: np.random.Generator) -> None:
    prior = 0.3
    error = np.array([[0.02, 0.012], [0.012, 0.03]])
    noise = error + np.eye(2) * THRESHOLDS.steadiness_px**2
    squares = []
    for _ in range(400):
        true = prior * random.standard_normal(2)
        seen = random.multivariate_normal(true, noise)
        measured = ImageShift(seen, error)
        shift, covariance = with_prior(measured, prior)
        squares.append((shift - true) @ np.linalg.solve(covariance, shift - true))
    assert np.mean(squares) == pytest.approx(2.0, abs=MOST_SIGMAS * 2 / np.sqrt(400))
