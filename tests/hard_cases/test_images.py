"""Images that show no pushed beam, or not as they should: an outcome, never wrong numbers."""

import re
import shutil
from collections.abc import Callable
from dataclasses import fields, replace
from math import radians
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from solver.antenna import Antenna
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.images import read_grey
from solver.instrument.observation import open_observations
from solver.instrument.rig import Gravity
from solver.methods import METHODS
from solver.set_up import set_up
from solver.tracker import PushTracker
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.hard_cases.beams import is_sound


def under_gravity(antenna: Antenna) -> Antenna:
    """State gravity that pulls across the beam, for the method that needs it."""
    return replace(antenna, rig=replace(antenna.rig, gravity=Gravity(radians(100), radians(5))))


@pytest.fixture(scope="module")
def antenna(antenna: Antenna) -> Antenna:
    return under_gravity(antenna)


@pytest.fixture(scope="module")
def images(dataset: Path) -> dict[str, Grey]:
    observations = open_observations(dataset / "observations")
    pushed = observations.frames[0].image()
    noise = generator(__name__, 0).normal(60, 20, pushed.shape).clip(0, 255).astype(np.uint8)
    stub = pushed.copy()
    stub[:, 60:] = np.median(pushed)
    return {
        "black": np.zeros_like(pushed),
        "white": np.full_like(pushed, 255),
        "noise": noise,
        "stub": stub,
        "board": read_grey(observations.board_views[0]),
        "upside down": np.ascontiguousarray(pushed[::-1]),
        "turned by 180 degrees": np.ascontiguousarray(pushed[::-1, ::-1]),
        "clamped at the right": np.ascontiguousarray(pushed[:, ::-1]),
        "black of 16 bits": np.zeros_like(pushed, dtype=np.uint16),
        "white of 16 bits": np.full(pushed.shape, 65535, dtype=np.uint16),
        "noise of 16 bits": noise.astype(np.uint16) * 257,
        "checkered": (np.indices(pushed.shape).sum(axis=0) % 2 * 255).astype(np.uint8),
        "a bright row": np.where(np.arange(pushed.shape[0])[:, None] == 100, 250, 0 * pushed),
        "a negative": 255 - pushed,
        "out of focus": np.asarray(cv2.GaussianBlur(pushed, (0, 0), 3.0), dtype=np.uint8),
    }


NO_PUSH = [
    *("black", "white", "noise", "stub", "board", "upside down", "turned by 180 degrees"),
    *("clamped at the right", "black of 16 bits", "white of 16 bits", "noise of 16 bits"),
    *("checkered", "a bright row", "a negative", "out of focus"),
]


# Linear theory is asked of pairs, or for the nearest beam, however far that is: a beam that is
# clamped at the wrong end may still look to it like one that is pushed.
ASKS_NO_MISFIT = {"two_point", "three_point", "moment_sensor", "stiffness", "linear_fit"}


@pytest.mark.thorough
@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("name", NO_PUSH)
def test_no_numbers_without_a_pushed_beam(
    images: dict[str, Grey], antenna: Antenna, method: str, name: str
) -> None:
    answer = PushTracker(antenna, METHODS[method]).solve(images[name]).estimate
    assert answer.outcome is not Outcome.CRASHED, answer.message
    assert is_sound(answer)
    if name != "turned by 180 degrees" or method not in ASKS_NO_MISFIT:
        assert not answer.values, answer


# What needs no sensor beside the camera.
VISUAL = sorted(METHODS.keys() - {"moment_sensor", "force_sensor"})


@pytest.mark.parametrize("method", VISUAL)
def test_a_beam_at_rest_is_no_contact(dataset: Path, antenna: Antenna, method: str) -> None:
    for path in open_observations(dataset / "observations").rest_images:
        answer = PushTracker(antenna, METHODS[method]).solve(read_grey(path)).estimate
        assert answer.outcome is Outcome.NO_CONTACT


@pytest.mark.false_alarm(0.0, "the place is bounded by the beam's ends")
@pytest.mark.parametrize("method", VISUAL)
def test_a_half_hidden_beam_is_still_answered(dataset: Path, antenna: Antenna, method: str) -> None:
    frame = open_observations(dataset / "observations").frames[0]
    image = frame.image()
    image[:, 330:] = np.median(image)
    answer = PushTracker(antenna, METHODS[method]).solve(image, frame.readings).estimate
    # A contact in the hidden half may be at the tip.
    assert answer.outcome in {Outcome.CONTACT, Outcome.TIP_CONTACT}
    assert 0 < answer.values["x_c_m"] < 0.24


def spoilt(image: Grey) -> dict[str, tuple[Any, str]]:
    """Arrays that are no image of the calibrated camera, and what is said of them."""
    kind = "allowed is one channel of 8 or 16 bits"
    return {
        "turned by 90 degrees": (np.rot90(image), "the image has 176 x 512 px"),
        "cropped": (image[4:-4], "the image has 512 x 168 px"),
        "halved": (image[::2, ::2], "the image has 256 x 88 px"),
        "empty": (image[:0], "the image has 512 x 0 px"),
        "nothing": (np.zeros((0, 0), np.uint8), "the image has 0 x 0 px"),
        "one pixel": (image[:1, :1], "the image has 1 x 1 px"),
        "of colour": (np.dstack([image] * 3), kind),
        "of colour and opacity": (np.dstack([image] * 4), kind),
        "of one channel more": (image[..., None], kind),
        "of real numbers": (image / 255, kind),
        "of NaN": (np.full(image.shape, np.nan), kind),
        "of 64 bits": (image.astype(np.int64), kind),
        "of truths": (image > 60, kind),
        "of the other byte order": (image.astype(">u2"), kind),
        "no array of numbers": (np.array(None), kind),
    }


def test_what_is_no_image_of_the_camera_is_invalid(dataset: Path, antenna: Antenna) -> None:
    image = open_observations(dataset / "observations").frames[0].image()
    for name, (wrong, sentence) in spoilt(image).items():
        for method in METHODS.values():
            answer = PushTracker(antenna, method).solve(wrong).estimate
            assert answer.outcome is Outcome.INVALID, name
            assert sentence in answer.message, name


# Largest change of an estimate that rounding may cause, in its own sigmas: an ill-posed estimate
# amplifies rounding as it does noise. Measured on 20 datasets: up to 0.001.
ROUNDING_SIGMAS = 0.01


def same(one: Estimate, other: Estimate) -> bool:
    """Whether outcomes are equal, and contact distance and force but for rounding."""
    return one.outcome is other.outcome and all(
        abs(one.values[name] - other.values[name]) <= ROUNDING_SIGMAS * one.sigma(name)
        for name in ("x_c_m", "force_n")
    )


@pytest.mark.thorough
def test_how_an_image_lies_in_memory_does_not_matter(dataset: Path, antenna: Antenna) -> None:
    frame = open_observations(dataset / "observations").frames[1]
    image = frame.image()
    lying = {
        "by columns": np.asfortranarray(image),
        "with gaps": np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)[::2, ::2],
        "from its end": np.ascontiguousarray(image[::-1])[::-1],
        "read-only": np.frombuffer(image.tobytes(), np.uint8).reshape(image.shape),
        "in 16 bits": image.astype(np.uint16),
    }
    # Methods do not get the image, only its centreline.
    tracker = PushTracker(antenna, METHODS["exact_fit"])
    plain = tracker.solve(image, frame.readings)
    assert plain.line is not None
    for name, other in lying.items():
        solution = tracker.solve(other, frame.readings)
        assert solution.line is not None, name
        for field in fields(plain.line):
            expected = getattr(plain.line, field.name)
            np.testing.assert_equal(getattr(solution.line, field.name), expected, name)
        assert solution.estimate.outcome is Outcome.CONTACT, name
        assert dict(solution.estimate.values) == dict(plain.estimate.values), name


def test_half_the_light_or_a_few_dead_pixels_do_little_harm(
    dataset: Path, antenna: Antenna, random: np.random.Generator
) -> None:
    frame = open_observations(dataset / "observations").frames[1]
    image = frame.image()
    dead = random.random(image.shape) < 0.05
    spots = np.where(dead, 255 * (random.random(image.shape) < 0.5), image).astype(np.uint8)
    for method in ("exact_fit", "exact_fit_3d", "push_fit"):
        plain = PushTracker(antenna, METHODS[method]).solve(image, frame.readings).estimate
        for other in (image // 2, spots):
            answer = PushTracker(antenna, METHODS[method]).solve(other, frame.readings).estimate
            assert answer.outcome is Outcome.CONTACT
            change = abs(answer.values["x_c_m"] - plain.values["x_c_m"])
            both = np.hypot(answer.sigma("x_c_m"), plain.sigma("x_c_m"))
            assert change < MOST_SIGMAS * both
            assert change < 0.005 * 0.24


def rewritten(dataset: Path, to: Path, change: Callable[[Grey], Any]) -> Path:
    """A copy of the observations, each image of which was changed."""
    shutil.copytree(dataset / "observations", to, ignore=shutil.ignore_patterns("hashes.json"))
    for path in to.rglob("*.png"):
        assert cv2.imwrite(str(path), np.ascontiguousarray(change(read_grey(path))))
    return to


def answers(observations: Path, antenna: Antenna | None = None) -> dict[str, Estimate]:
    opened = open_observations(observations)
    antenna, frame = antenna or under_gravity(set_up(opened)), opened.frames[1]
    image = frame.image()
    return {
        name: PushTracker(antenna, METHODS[name]).solve(image, frame.readings).estimate
        for name in VISUAL
    }


@pytest.mark.thorough
def test_a_camera_of_16_bits_or_of_another_mounting_sees_the_same(
    dataset: Path, antenna: Antenna, tmp_path: Path
) -> None:
    plain = answers(dataset / "observations", antenna)
    assert plain["exact_fit"].outcome is Outcome.CONTACT
    wide = answers(
        rewritten(dataset, tmp_path / "wide", lambda image: image.astype(np.uint16) * 257)
    )
    # The image's columns then run along the beam's other side.
    upright = answers(rewritten(dataset, tmp_path / "upright", lambda image: np.rot90(image, -1)))
    for name, one in plain.items():
        if one.values:
            assert same(wide[name], one), name
            assert same(upright[name], one), name


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        # A mirror; a rotation by any angle is no mistake.
        (lambda image: image[::-1], "or the images are mirrored"),
        (np.zeros_like, "does not show the whole board"),
    ],
)
def test_a_camera_that_stands_wrongly_is_refused(
    dataset: Path, tmp_path: Path, change: Callable[[Grey], Any], sentence: str
) -> None:
    tree = rewritten(dataset, tmp_path / "wrong", change)
    with pytest.raises(InputError, match=f"^{re.escape(str(tree))}: .*{sentence}"):
        set_up(open_observations(tree))
