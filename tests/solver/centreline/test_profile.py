from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.centreline.noise import Noise
from solver.centreline.profile import (
    SLOPES,
    STEP,
    Section,
    nearest_table,
    profile,
    tilt_response,
)
from solver.centreline.profile_fit import Fits, fit_profiles
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats, Grey
from tests.beam_images import Look, Sensor, cover
from tests.consistency import MOST_SIGMAS
from tests.draws import generator

FINE = {"points": 6765, "generator": 4181}
LOOK = Look(roundness=0.6)
SECTION = Section(LOOK.radius_px, LOOK.spread_px, LOOK.roundness, 0.0)
HALF = 7
QUIET = Noise(1.0, 0.0)


def places(rows: Floats, climb: float) -> Stations:
    """Stations at the columns 0, 1, ... of a beam that runs to the right along `rows` (n,)."""
    n = len(rows)
    return Stations(
        along=np.arange(n),
        upright=np.ones(n, bool),
        start=np.rint(rows) + 0.3,
        climb=np.full(n, climb),
        sense=np.ones(n),
        length=np.arange(float(n)) * float(np.hypot(1, climb)),
    )


def line(rows: Floats) -> Floats:
    """Pixels (n, 2) of a straight beam along rows, and well beyond the first and last column."""
    slope = rows[1] - rows[0]
    u = np.array([-30.0, -15, 0, len(rows) + 15, len(rows) + 30])
    return np.column_stack([u, rows[0] + slope * u])


def fit(image: Grey, at: Stations, noise: Noise = QUIET, section: Section = SECTION) -> Fits:
    return fit_profiles(image, at, profile(section), noise, HALF, int(np.iinfo(image.dtype).max))


def test_an_even_band_without_spread_is_a_trapezoid() -> None:
    radius = 0.8
    table = profile(Section(radius, 0.0, 0.0, 0.0))
    middle = table.value.shape[2] // 2
    t = (np.arange(table.value.shape[2]) - middle) * STEP
    trapezoid = np.clip((radius + 0.5 - np.abs(t)) / (2 * radius), 0, 1 / (2 * radius))
    # Nowhere farther off than the trapezoid climbs within a step of the table.
    assert np.abs(table.value[0, 0] - trapezoid).max() < STEP / (2 * radius)


@pytest.mark.parametrize(
    "section", [SECTION, Section(3.0, 0.2, 1.0, 0.4), Section(0.3, 1.5, 2.0, -0.3)]
)
def test_the_table_has_the_area_of_a_beam_crossed_aslant(section: Section) -> None:
    table = profile(section)
    stretch = np.hypot(1, np.linspace(0, 1, SLOPES))
    assert table.value[0].sum(axis=1) * STEP == pytest.approx(stretch, rel=1e-3)
    differences = np.gradient(table.value[0], STEP, axis=1)[:, 2:-2]
    assert np.abs(table.slope[0, :, 2:-2] - differences).max() < 0.02 * np.abs(table.slope).max()


@pytest.mark.thorough
def test_a_tapered_beam_has_the_table_of_each_width() -> None:
    section = Section(0.8, 0.4, 1.0, 0.1, -0.5)
    tables = profile(section, 200.0)
    assert tables.radius[[0, -1]] == pytest.approx([1.0, 0.6])
    nearest = [nearest_table(tables, length) for length in (-5.0, 0.0, 100.0, 200.0, 230.0)]
    assert tables.radius[nearest] == pytest.approx([1.0, 1.0, 0.8, 0.6, 0.6])
    for j, radius in enumerate(tables.radius):
        alone = profile(Section(float(radius), 0.4, 1.0, 0.1)).value[0]
        margin = (tables.value.shape[2] - alone.shape[1]) // 2
        assert tables.value[j, :, margin : -margin or None] == pytest.approx(alone, abs=1e-6)


@pytest.mark.parametrize("climb", [0.0, 0.37, 1.0])
@pytest.mark.parametrize("skew", [0.0, 0.5])
def test_the_table_is_what_a_lattice_of_points_sees(climb: float, skew: float) -> None:
    look = Look(roundness=1.0, skew=skew, spread_px=0.4)
    rows = 20.0 + 0.21 + climb * np.arange(12.0)
    _, light = cover(line(rows), look, (48, 12), **FINE)
    table = profile(Section(look.radius_px, look.spread_px, look.roundness, skew))
    index = round(climb * (SLOPES - 1))
    middle, wanted = table.value.shape[2] // 2, table.value[0, index]
    beside = table.value[0, min(index + 1, SLOPES - 1)]
    share = climb * (SLOPES - 1) - index
    wanted = wanted + (beside - wanted) * share
    # The chord's mean height is pi / 4.
    area = 2 * look.radius_px * np.pi / 4
    for u in (4, 6, 8):
        at = (np.arange(48) - rows[u]) / STEP + middle
        expected = area * np.interp(at, np.arange(len(wanted)), wanted, left=0, right=0)
        assert np.abs(light[:, u] - expected).max() < 0.004


@pytest.mark.parametrize("climb", [0.005, 0.255, 0.505, 0.995, -0.305])
def test_centres_follow_no_pixel_grid(climb: float) -> None:
    """The S-curve: the error over all phases of the pixel, without noise."""
    # Phases are 0.01 px apart or less.
    columns = 200 if abs(climb) < 0.01 else 100
    rows = (20.0 if climb > 0 else 110.0) + climb * np.arange(float(columns))
    height = int(max(rows[0], rows[-1])) + 20
    covered, light = cover(line(rows), LOOK, (height, columns), **FINE)
    image = np.rint(2000 + 60000 * (0.05 * (1 - covered) + light * 0.9)).astype(np.uint16)
    found = fit(image, places(rows, climb))
    assert np.abs(found.centre - rows).max() < 0.003
    assert found.amplitude.std() < 0.01 * found.amplitude.mean()


@cache
def paper_line() -> tuple[Floats, Floats]:
    """The paper's conditions: 1.6 px wide, the brightest pixel at 70 % of the full well."""
    rows = 16.0 + 0.017 * np.arange(240.0)
    covered, light = cover(line(rows), LOOK, (40, 240), **FINE)
    shown = 0.02 * (1 - covered) + light
    return rows, shown * 0.7 / shown.max()


def test_centres_scatter_as_their_sigma_says(random: np.random.Generator) -> None:
    rows, light = paper_line()
    sensor = Sensor()
    gain = 255 / sensor.full_well
    noise = Noise((sensor.read_noise * gain) ** 2 + 1 / 12, gain)
    found = [fit(sensor(light, random), places(rows, 0.017), noise) for _ in range(20)]
    error = np.concatenate([f.centre - rows for f in found])
    sigma = np.concatenate([f.sigma for f in found])
    # 4,800 centres tell a scatter to 1 %.
    assert error.std() == pytest.approx(np.sqrt(np.mean(sigma**2)), rel=0.07)
    assert 0.005 < error.std() < 0.0085
    assert abs(error.mean()) < MOST_SIGMAS * error.std() / np.sqrt(len(error))
    chi2 = np.concatenate([f.chi2 / f.dof for f in found])
    assert chi2.mean() == pytest.approx(1.0, abs=0.12)


def test_pixels_at_full_scale_are_left_out(random: np.random.Generator) -> None:
    rows, light = paper_line()
    sensor = Sensor()
    noise = Noise(0.15, 255 / sensor.full_well)
    found = fit(sensor(light * 1.7, random), places(rows, 0.017), noise)
    assert np.count_nonzero(found.saturated) > 100
    error = (found.centre - rows) / found.sigma
    cut = found.saturated > 0
    assert np.abs(error[cut]).max() < 6
    assert np.sqrt(np.mean(error[cut] ** 2)) < 1.4
    assert found.sigma[cut].mean() > found.sigma[~cut].mean()


@pytest.fixture(scope="module")
def photographed() -> Grey:
    _, light = paper_line()
    return Sensor()(light, generator(__name__, 7))


@settings(max_examples=20)
@given(gain=st.floats(1.0, 200.0), offset=st.floats(0.0, 5000.0))
def test_gain_and_offset_move_no_centre(photographed: Grey, gain: float, offset: float) -> None:
    rows, _ = paper_line()
    # The offset is electrons' no more: the noise stays what it was.
    deep = np.rint(256 * 0.75 * photographed.astype(float)).astype(np.uint16)
    other = np.rint(gain * photographed.astype(float) + offset)
    a = fit(deep, places(rows, 0.017), Noise(200.0, 0.0))
    b = fit(other.astype(np.uint16), places(rows, 0.017), Noise(gain**2, 0.0))
    # What rounding to whole values does to the fainter of the two.
    assert np.abs(a.centre - b.centre).max() < 0.012 / gain + 1e-4


@settings(max_examples=20)
@given(phase=st.floats(-0.4, 0.4), skew=st.floats(-0.6, 0.6))
def test_the_mirrored_image_has_the_mirrored_centres(phase: float, skew: float) -> None:
    rows, light = paper_line()
    image = Sensor()(light, generator(__name__, 8))
    at = places(rows, 0.017)
    start = at.start + phase
    top = image.shape[0] - 1
    upward = Stations(at.along, at.upright, top - start, at.climb, at.sense, at.length)
    downward = Stations(at.along, at.upright, start, at.climb, at.sense, at.length)
    section = Section(SECTION.radius, SECTION.spread, SECTION.roundness, skew)
    mirrored = Section(SECTION.radius, SECTION.spread, SECTION.roundness, -skew)
    a = fit(image, downward, Noise(0.15, 0.0255), section)
    b = fit(np.ascontiguousarray(image[::-1]), upward, Noise(0.15, 0.0255), mirrored)
    assert np.abs(a.centre - (top - b.centre)).max() < 1e-4
    assert a.sigma == pytest.approx(b.sigma, rel=1e-3)


def test_a_station_at_the_image_s_rim_has_no_centre() -> None:
    image = np.full((40, 10), 20, np.uint8)
    at = places(np.full(10, 3.0), 0.0)
    assert np.isinf(fit(image, at).sigma).all()


@pytest.mark.parametrize(("radius", "expected"), [(0.5, 1.0), (13.0, None)])
def test_a_tilt_of_the_brightness_moves_a_fitted_centre(
    radius: float, expected: float | None
) -> None:
    section, tilt, half = Section(radius, 0.4, 1.0, 0.0), 0.02, int(radius) + 5
    offset = np.arange(-half - 5, half + 6)
    # Strips across the section, blurred by the pixel and by sampling the point spread.
    x = np.linspace(-1, 1, 4001)
    brightness = np.sqrt(1 - x**2) + tilt * x
    spread = 0.4 * np.linspace(-4, 4, 161)
    weight = np.exp(-(spread**2) / (2 * 0.4**2))
    column = np.zeros(len(offset))
    for shift, share in zip(spread, weight / weight.sum(), strict=True):
        place = np.floor(radius * x + shift + 0.5).astype(int) + half + 5
        np.add.at(column, place, share * brightness)
    image = np.repeat(column[:, None] * (40_000 / column.max()) + 500, 9, axis=1)
    at = places(np.full(9, float(half + 5)), 0.0)
    table, noise = profile(section), Noise(1e6, 0.0)
    moved = fit_profiles(np.rint(image).astype(np.uint16), at, table, noise, half, 65_535)
    middle = radius * tilt * (2 / 3) / (np.pi / 2)
    response = tilt_response(table, section, np.array([1.0, 0.0]), half)
    centre = float(np.median(moved.centre)) - (half + 5)
    assert centre / middle == pytest.approx(response, abs=0.03)
    assert response == pytest.approx(expected, abs=0.05) if expected else response < 0.85
