"""Beams whose tangent turns by up to 80 degrees are followed to their tip."""

from functools import cache

import numpy as np
import pytest

from solver.centreline.extractor import BeamExtractor, learn_profile_fit
from solver.centreline.following import follow
from solver.instrument.arrays import Floats
from tests.beam_images import Look, Sensor, bent, distances, drawn, guide
from tests.draws import generator

SIZE = (320, 520)
TILT = 3e-3
SENSOR = Sensor()


@cache
def learned(look: Look, roll: float) -> BeamExtractor:
    random, seen_by = generator(__name__, 0), guide(roll, *SIZE)
    light = drawn(seen_by, bent(0.0, tilt=TILT), look)
    return learn_profile_fit([SENSOR(light, random) for _ in range(2)], seen_by)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("look", "roll", "theta", "s_c"),
    [
        (Look(), 0.0, 1.4, 0.6),
        (Look(), np.pi / 4, 1.0, 0.9),
        (Look(), np.pi, 1.4, 0.9),
        (Look().dark, 0.0, 1.2, 0.9),
    ],
    ids=["up", "diagonal", "left", "dark"],
)
def test_a_far_bent_beam_is_measured_to_its_tip(
    look: Look, roll: float, theta: float, s_c: float, random: np.random.Generator
) -> None:
    seen_by, shape = guide(roll, *SIZE), bent(theta, s_c, TILT)
    light = drawn(seen_by, shape, look)
    line = learned(look, roll)(SENSOR(light, random))
    pixels = seen_by.pixels(shape)
    margins = np.minimum(pixels, np.array(light.shape[::-1]) - 1 - pixels)
    inside = np.asarray(margins.min(axis=1) > 6)
    crossed = np.abs(np.diff(pixels[inside], axis=0)).max(axis=1).sum()
    assert len(line.points) > 0.8 * crossed
    error = distances(line.points, pixels)
    assert np.sqrt(np.mean(error**2)) < 0.065  # of a dark beam 0.021 +- 0.008
    if inside[-1]:
        assert line.tip is not None
        assert np.hypot(*(line.tip - pixels[-1])) < 1.0


def test_a_gap_is_crossed_and_the_end_is_the_beams_length() -> None:
    seen_by = guide(0.0, *SIZE)
    pixels = seen_by.pixels(bent(1.2, 0.7))
    start = pixels[:1500:12]

    def measure(nodes: Floats) -> Floats:
        near = np.hypot(*(pixels[None] - nodes[:, None]).transpose(2, 0, 1)).argmin(axis=1)
        measured = pixels[near.min() : near.max() : 14]
        hidden = np.abs(measured - pixels[2000]).max(axis=1) < 14
        return np.asarray(measured[~hidden])

    path = follow(start, seen_by, measure)
    assert path is not None
    course = seen_by.pixels(path)
    on_beam = course[: int(len(course) / 1.06) - 1]
    away = np.hypot(*(pixels[None] - on_beam[:, None]).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < 1.0
    assert np.hypot(*(course[-1] - pixels[-1])) < 0.08 * np.hypot(*np.diff(pixels, axis=0).T).sum()


def test_too_few_points_are_not_followed() -> None:
    assert follow(np.zeros((3, 2)), guide(), lambda nodes: nodes) is None


def test_points_that_lead_nowhere_are_a_gap() -> None:
    """All measured points are beside the last node: the path goes on as it was, and ends."""
    seen_by = guide(0.0, *SIZE)
    pixels = seen_by.pixels(bent(0.3, 0.7))
    path = follow(pixels[:800:12], seen_by, lambda nodes: np.repeat(nodes[:1], 20, axis=0) + 0.5)
    assert path is not None
    assert np.isfinite(path).all()
