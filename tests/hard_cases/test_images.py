"""Images that show no pushed beam: every method answers with an outcome, never with numbers."""

from pathlib import Path

import numpy as np
import pytest

from solver.estimate import Antenna, estimate, set_up
from solver.instrument.arrays import Grey
from solver.instrument.estimate import Outcome
from solver.instrument.images import read_grey
from solver.instrument.observation import open_observations
from solver.methods import METHODS


@pytest.fixture(scope="module")
def antenna(dataset: Path) -> Antenna:
    return set_up(open_observations(dataset / "observations"))


def images(dataset: Path) -> dict[str, Grey]:
    observations = open_observations(dataset / "observations")
    pushed = observations.frames[0].image()
    noise = np.random.default_rng(0).normal(60, 20, pushed.shape).clip(0, 255).astype(np.uint8)
    stub = pushed.copy()
    stub[:, 60:] = np.median(pushed)
    return {
        "black": np.zeros_like(pushed),
        "white": np.full_like(pushed, 255),
        "noise": noise,
        "stub": stub,
        "board": read_grey(observations.board_views[0]),
        "upside down": np.ascontiguousarray(pushed[::-1]),
    }


@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("name", ["black", "white", "noise", "stub", "board", "upside down"])
def test_no_numbers_without_a_pushed_beam(
    dataset: Path, antenna: Antenna, method: str, name: str
) -> None:
    answer = estimate(antenna, images(dataset)[name], METHODS[method])
    assert answer.outcome is not Outcome.CRASHED, answer.message
    assert not answer.values, answer


# What needs no sensor beside the camera.
VISUAL = sorted(METHODS.keys() - {"moment_sensor", "force_sensor"})


@pytest.mark.parametrize("method", VISUAL)
def test_a_beam_at_rest_is_no_contact(dataset: Path, antenna: Antenna, method: str) -> None:
    for path in open_observations(dataset / "observations").rest_images:
        answer = estimate(antenna, read_grey(path), METHODS[method])
        assert answer.outcome is Outcome.NO_CONTACT


@pytest.mark.parametrize("method", VISUAL)
def test_a_half_hidden_beam_is_still_answered(dataset: Path, antenna: Antenna, method: str) -> None:
    frame = open_observations(dataset / "observations").frames[0]
    image = frame.image()
    image[:, 330:] = np.median(image)
    answer = estimate(antenna, image, METHODS[method], frame.readings)
    assert answer.outcome is Outcome.CONTACT
    assert 0 < answer.values["x_c_m"] < 0.24
