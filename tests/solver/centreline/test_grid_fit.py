import numpy as np
import pytest

from solver.centreline.grid_fit import fit_grid_error
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats
from solver.instrument.grid_error import GridError

COLUMNS = np.arange(20.0, 460.0)
SIGMA_PX = 0.01
# Frequencies along and across the beam [1/px], and coefficients of cosine and sine [px].
MOSAIC = ((0.5, 0.5, 0.1, -0.12), (0.0, 0.5, 0.09, 0.03), (0.0, 1.0, -0.02, 0.03))


def course(rows: float) -> Floats:
    """Place (n,) [px] of a bent beam that crosses `rows` pixel rows."""
    t = (COLUMNS - COLUMNS[0]) / np.ptp(COLUMNS)
    return np.asarray(90.3 + rows * (1.5 * t**2 - 0.5 * t**3))


def waves(places: Floats, terms: tuple[tuple[float, ...], ...] = MOSAIC) -> Floats:
    total = np.zeros(len(places))
    for a, b, cosine, sine in terms:
        phase = 2 * np.pi * (a * COLUMNS + b * places)
        total += cosine * np.cos(phase) + sine * np.sin(phase)
    return total


def fitted(residual: Floats, places: Floats, upright: bool = True) -> GridError | None:
    n = len(COLUMNS)
    stations = Stations(
        COLUMNS.astype(np.int64), np.full(n, upright), places, np.zeros(n), np.ones(n), COLUMNS
    )
    return fit_grid_error(stations, places, residual, np.ones(n, bool), period=2)


@pytest.mark.parametrize("upright", [True, False])
def test_waves_are_found_beside_noise_and_outliers(
    upright: bool, random: np.random.Generator
) -> None:
    places = course(40.0)
    residual = waves(places) + SIGMA_PX * random.standard_normal(len(places))
    residual[100:104] += 1.0
    error = fitted(residual, places, upright)
    assert error is not None
    assert error.upright == upright
    assert error.at(COLUMNS, places) == pytest.approx(waves(places), abs=6 * SIGMA_PX / 10)
    found = {tuple(pair) for pair in error.frequencies.tolist()}
    assert {(a, b) for a, b, _, _ in MOSAIC} <= found


def test_the_covariance_is_that_of_the_errors(random: np.random.Generator) -> None:
    places, squares = course(40.0), []
    at_rest = np.full(len(places), 90.4)
    for _ in range(100):
        residual = waves(places) + SIGMA_PX * random.standard_normal(len(places))
        error = fitted(residual, places)
        assert error is not None
        across = error.across
        left = across.at(COLUMNS, at_rest) - waves(at_rest)
        sigma = np.sqrt((across.errors_at(COLUMNS, at_rest) ** 2).sum(axis=1))
        squares.append(np.mean(left**2) / np.mean(sigma**2))
    # Waves that noise alone made significant have larger errors than stated.
    assert 0.6 < np.mean(squares) < 1.5  # 1 +- 0.08


def test_noise_is_no_wave(random: np.random.Generator) -> None:
    places = course(40.0)
    error = fitted(SIGMA_PX * random.standard_normal(len(places)), places)
    assert error is not None
    assert np.std(error.at(COLUMNS, places)) < 0.25 * SIGMA_PX
    assert (error.frequencies[:, 0] == 0).all()


def test_waves_along_the_beam_are_left_out_across_it(random: np.random.Generator) -> None:
    places, along = course(40.0), ((0.5, 0.0, 0.1, 0.0),)
    residual = waves(places, along) + SIGMA_PX * random.standard_normal(len(places))
    error = fitted(residual, places)
    assert error is not None
    assert error.at(COLUMNS, places) == pytest.approx(waves(places, along), abs=6e-3)
    assert np.abs(error.across.at(COLUMNS, places)).max() < 6e-3


@pytest.mark.parametrize("rows", [0.0, 1.0])
def test_a_beam_along_the_rows_shows_no_grid(rows: float) -> None:
    places = course(rows)
    assert fitted(waves(places), places) is None
