"""The profile of polished steel: a bright line between dark flanks, which no section describes."""

from functools import cache

import numpy as np
import pytest
from scipy.special import ndtr

from solver.centreline import Centreline
from solver.centreline.effective_profile import course_basis, effective_profile, read_columns
from solver.centreline.extractor import BeamExtractor, learn_profile_fit
from solver.centreline.noise import Noise
from solver.centreline.profile import Section, profile
from solver.centreline.stations import stations
from solver.instrument.arrays import Floats, Grey
from tests.beam_images import HEIGHT, WIDTH, Sensor, bent, guide
from tests.draws import generator

TILT = 0.02
RADIUS_PX = 0.8
SENSOR = Sensor()
GROUND = 0.3
SUBPIXELS = 16


def steel(across: Floats) -> Floats:
    """Brightness of the beam and its ground, at distances [px] from its axis."""
    beam = 0.12 + 1.2 * np.exp(-(((across - 0.2) / 0.35) ** 2))
    edge = ndtr((1.4 - np.abs(across)) / 0.2)
    return np.asarray(GROUND + (beam - GROUND) * edge)


def drawn(theta: float) -> tuple[Floats, Floats]:
    """Light (height, width) of a beam bent by `theta`, and its pixels (n, 2)."""
    pixels = guide().pixels(bent(theta, tilt=TILT))
    columns = np.arange(WIDTH)
    fine = (np.arange(HEIGHT * SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    order = np.argsort(pixels[:, 0])
    u, v = pixels[order].T
    centre, slope = np.interp(columns, u, v), np.interp(columns, u, np.gradient(v, u))
    # Image rows run against the beam's own normal.
    across = (centre - fine[:, None]) / np.hypot(1, slope)
    light = np.where((columns >= u[0]) & (columns <= u[-1]), steel(across), GROUND)
    return light.reshape(HEIGHT, SUBPIXELS, WIDTH).mean(axis=1), pixels


def images(theta: float, first: int, n: int) -> tuple[list[Grey], Floats]:
    light, pixels = drawn(theta)
    return [SENSOR(light, generator(__name__, first + k)) for k in range(n)], pixels


@cache
def learned() -> BeamExtractor:
    return learn_profile_fit(images(0.0, 0, 4)[0], guide())


@pytest.mark.thorough
def test_the_profile_of_steel_leaves_little_more_than_noise() -> None:
    section = learned().appearance.section
    assert learned().appearance.misfit < 2
    # The search of a section has found none that leaves as little.
    rest, pixels = images(0.0, 0, 4)
    places = stations(pixels[::40], (HEIGHT, WIDTH))
    columns = read_columns(rest, places, 6, Noise(1.0, 0.03), 255)
    sampled = effective_profile(columns, 4.0, 1)
    assert sampled is not None
    best = sampled.table.value[0, 0]
    assert best.min() < -0.2 * best.max()
    # Below 0 by the rounding of double integrals only.
    assert profile(section).value.min() > -1e-12


def test_the_scale_of_the_gray_values_does_not_matter() -> None:
    rest, pixels = images(0.0, 0, 2)
    columns = read_columns(rest, stations(pixels[::40], (HEIGHT, WIDTH)), 6, Noise(1.0, 0.03), 255)
    dim = columns._replace(gray=columns.gray / 257, variance=columns.variance / 257**2)
    one, other = effective_profile(columns, 4.0, 1), effective_profile(dim, 4.0, 1)
    assert one is not None
    assert other is not None
    assert other.off_path == pytest.approx(one.off_path, abs=1e-6)
    assert other.table.value == pytest.approx(one.table.value, abs=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("theta", [0.05, 0.15, 0.3])
def test_a_bent_steel_beam_is_measured_to_a_fortieth_of_a_pixel(theta: float) -> None:
    several, pixels = images(theta, 50, 4)
    spread = []
    for image in several:
        line = learned()(image)
        spread.append(_spread(line, pixels))
    assert np.mean(spread) < 0.025


def _spread(line: Centreline, pixels: Floats) -> float:
    """Check a measured line, and return the standard deviation of its errors [px]."""
    # Noise decides which columns are flagged: 0.83 +- 0.05 are kept at the largest bend.
    assert len(line.points) > 0.5 * np.ptp(pixels[pixels[:, 1] > 0, 0])
    order = np.argsort(pixels[:, 0])
    error = line.points[:, 1] - np.interp(line.points[:, 0], *pixels[order].T)
    # The axis is that of the whole beam, not of its highlight 0.2 px beside it.
    assert abs(error.mean()) < 0.15
    return float((error - error.mean()).std())


def test_the_course_is_that_of_the_beam() -> None:
    """Started beside the beam and askew, the profile's fit finds its course."""
    rest, pixels = images(0.0, 0, 4)
    askew = pixels[::40] + np.column_stack([np.zeros(101), np.linspace(0.8, -0.6, 101)])
    places = stations(askew, (HEIGHT, WIDTH))
    columns = read_columns(rest, places, 6, Noise(1.0, 0.03), 255)
    sampled = effective_profile(columns, 4.0, 1)
    assert sampled is not None
    course = sampled.off_path
    expected = np.interp(places.along, pixels[:, 0], pixels[:, 1]) - places.start
    error = places.sense * course - expected
    assert abs(error.mean()) < 0.15
    assert np.abs(error - error.mean()).max() < 0.03


def test_a_section_is_sampled_as_it_is() -> None:
    """A beam that a section describes has the same effective profile."""
    section = Section(RADIUS_PX, 0.5, 1.0, 0.0)
    table = profile(section)
    light = np.full((HEIGHT, WIDTH), GROUND)
    columns = np.arange(WIDTH)
    centre = 60 + 0.02 * columns
    half = table.value.shape[2] // 2
    offset = (np.arange(HEIGHT)[:, None] - centre) * 64 + half
    light += 0.5 * np.interp(offset, np.arange(2 * half + 1), table.value[0, 0])
    rest = [SENSOR(light, generator(__name__, k)) for k in range(16)]
    path = np.column_stack([columns, centre]).astype(np.float64)
    read = read_columns(rest, stations(path, light.shape), 6, Noise(1.0, 0.03), 255)
    effective = effective_profile(read, 4.0, 1)
    assert effective is not None
    sampled = effective.table.value[0, 0]
    middle = len(sampled) // 2
    near = np.arange(-192, 193, 16)
    assert np.abs(sampled[middle + near] - table.value[0, 0][half + near]).max() < 0.03


@pytest.mark.parametrize("what", ["saturated", "beside the image", "without noise"])
def test_columns_that_show_too_little_give_no_profile(what: str) -> None:
    light, pixels = drawn(0.0)
    gray = np.clip(255 * light, 0, 255).astype(np.uint8)
    path = pixels[::40]
    if what == "saturated":
        gray[:] = 255
    if what == "beside the image":
        path = path - np.array([0.0, pixels[:, 1].max() - 5])
    columns = read_columns([gray], stations(path, gray.shape), 6, Noise(1.0, 0.03), 255)
    effective = effective_profile(columns, 4.0, 1)
    assert (effective is None) == (what != "without noise")
    assert effective is None or np.isfinite(effective.table.value).all()


def test_a_smooth_course_is_constant_beyond_what_is_used() -> None:
    used = np.linspace(20.0, 300.0, 50)
    ends = course_basis(used[[0, -1]], used)
    assert (course_basis(np.array([-500.0, 900.0]), used) == ends).all()
    assert (course_basis(used[[1, -2]], used) != ends).any(axis=1).all()
