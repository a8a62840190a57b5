"""Dirt on the beam: found at rest, distinguished from errors that do not follow it, subtracted."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from solver.at_rest.pattern import NODES, SPREAD, pattern_of, share_that_follows
from solver.at_rest.rest_line import RestLine, fit_rest_line
from solver.centreline import Centreline, down_columns
from solver.instrument.arrays import Floats
from solver.instrument.transforms import invert
from solver.to_measurement import to_measurement
from tests.beam_images import bent, distances
from tests.draws import generator
from tests.laboratory import CALIBRATION, GUIDE, antenna_with, rig

SIGMA_PX, IMAGES = 0.01, 4
S = np.linspace(0.0, 1.0, 400)


def dirt(s: Floats, seed: int, size: float = 1.0) -> Floats:
    """A pattern (n,) along the beam, of root mean square `size`: waves of 1/4 to 1/12 of it."""
    random = generator(__name__, seed)
    waves = [
        random.standard_normal() * np.sin(2 * np.pi * (k * s + random.uniform()))
        for k in (4.2, 6.1, 7.7, 9.4, 12.0)
    ]
    total = np.sum(waves, axis=0)
    return np.asarray(size * total / np.std(total))


def test_a_wave_is_found_as_the_average_leaves_it() -> None:
    """A Gaussian of sigma a reduces a wave of frequency f by exp(-2 (pi f a)^2)."""
    f, fine = 10.0, np.linspace(0.0, 1.0, 8000)
    found = pattern_of(fine, np.sin(2 * np.pi * f * fine), np.full(8000, 0.5), 0.25)
    nodes = np.linspace(0.0, 1.0, NODES)
    inner = (nodes > 0.05) & (nodes < 0.95)
    expected = np.exp(-2 * (np.pi * f * SPREAD) ** 2) * np.sin(2 * np.pi * f * nodes)
    assert_allclose(found[inner], expected[inner], atol=2e-3)


def test_noise_is_no_pattern(random: np.random.Generator) -> None:
    found = [
        pattern_of(S, random.standard_normal(len(S)) / 2, np.ones(len(S)), 0.25) for _ in range(300)
    ]
    assert sum(len(pattern) > 0 for pattern in found) <= 3


def test_a_pattern_that_the_noise_of_an_image_would_hide_is_none() -> None:
    sigma = np.ones(len(S))
    assert len(pattern_of(S, dirt(S, 1, 0.5), sigma, 0.25)) == NODES
    assert not len(pattern_of(S, dirt(S, 1, 0.05), sigma, 1e-6))


@pytest.mark.thorough
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_share_is_that_of_the_pattern_that_follows(
    share: float, random: np.random.Generator
) -> None:
    found = []
    course = 8.0 * np.abs(S - 0.6) ** 3  # the third derivative jumps at a contact
    for seed in range(1000):
        own, other = dirt(S, 2 * seed, np.sqrt(share)), dirt(S, 2 * seed + 1, np.sqrt(1 - share))
        beside = course + own + dirt(S, 5000 + seed, np.sqrt(1 - share))
        noise = random.standard_normal(len(S))
        found.append(share_that_follows(S, own + other, beside + noise, np.ones(len(S))))
    # The other pattern's chance likeness to the first is that of ten independent waves: 0.3 to
    # either side, of which the shares below 0 and above 1 are cut off. The median has no bias.
    assert np.median(found) == pytest.approx(share, abs=0.1)


def test_too_few_points_show_nothing() -> None:
    for n in (0, 1, 5):
        few = np.linspace(0.4, 0.41, n)
        assert share_that_follows(few, np.ones(n), np.ones(n), np.ones(n)) == 0.0


def shown(shape: Floats, pattern: Floats, random: np.random.Generator) -> Centreline:
    """The centreline of a beam along `shape` (n, 2) [m], moved by a pattern (n,) [px]."""
    pixels = GUIDE.pixels(shape)
    tangent = np.gradient(pixels, axis=0)
    tangent /= np.hypot(*tangent.T)[:, None]
    pixels = pixels + pattern[:, None] * np.column_stack([tangent[:, 1], -tangent[:, 0]])
    columns = np.arange(np.ceil(pixels[0, 0]), pixels[-1, 0])
    rows = np.interp(columns, *pixels.T) + SIGMA_PX * random.standard_normal(len(columns))
    return down_columns(np.column_stack([columns, rows]), np.full(len(columns), SIGMA_PX))


def learned(pattern: Floats, random: np.random.Generator) -> RestLine:
    shape = bent(0.0, tilt=0.04)[::10]
    return fit_rest_line([shown(shape, pattern, random) for _ in range(IMAGES)], CALIBRATION, rig())


@pytest.mark.parametrize("follows", [True, False])
def test_dirt_is_taken_off_and_counts_no_longer_as_an_error_of_the_bow(
    follows: bool, random: np.random.Generator
) -> None:
    shape = bent(0.4, 0.6, tilt=0.04)[::10]
    arc = np.linspace(0.0, 1.0, len(shape))
    off, sigma = [], []
    for seed in range(30):
        rest = learned(dirt(arc, seed, 0.02), random)
        assert len(rest.pattern) == NODES
        line = shown(shape, dirt(arc, seed if follows else seed + 100, 0.02), random)
        for used in (rest, replace(rest, pattern=np.empty(0))):
            lab = antenna_with(used)
            measured = to_measurement(lab, line)
            beam = invert(lab.antenna_from_beam)
            away = distances(measured.points, shape @ beam[:2, :2].T + beam[:2, 3])
            # Means of ten neighbours, whose noise is small.
            off.append(np.std(np.convolve(away, np.full(10, 0.1), "valid")))
            assert measured.rest_bow is not None
            sigma.append(np.sqrt(np.trace(measured.rest_bow.covariance[2:, 2:])))
    with_pattern, without = np.mean(off[::2]), np.mean(off[1::2])
    if follows:
        assert with_pattern < 0.5 * without
        assert np.median(sigma[::2]) < 0.6 * np.median(sigma[1::2])
    else:
        assert with_pattern < 1.1 * without
