"""Information of a profile: closed forms, convergence, and estimates from noisy exposures."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from solver.instrument.arrays import Floats
from vbaa_bench.limits import profile
from vbaa_bench.limits.profile import SHIFT, WIDTH, SurfaceProfile, gray_profile, information
from vbaa_bench.sensor.sensor import Sensor

ACROSS_ROWS = np.array([0.0, 1.0])
SLANTED = np.array([np.sin(0.4), np.cos(0.4)])
DISC = np.sqrt(1 - ((np.arange(200) + 0.5) / 100 - 1) ** 2)


def steady(mean: Floats) -> Floats:
    """Noise with the same variance, 1, in all pixels."""
    return np.ones_like(mean)


def test_a_sharp_bar_across_the_rows_has_two_edges() -> None:
    # Each edge changes one pixel by the contrast: 2 A^2 / sigma^2.
    bar = SurfaceProfile(np.full(100, 5.0), 2.0, 1.3, ACROSS_ROWS)
    matrix = information(bar, steady)
    assert matrix[SHIFT, SHIFT] == pytest.approx(2 * 3.0**2, rel=0.01)
    # Relative widening moves both edges by the half width, in opposite directions.
    assert matrix[WIDTH, WIDTH] == pytest.approx(2 * 3.0**2 * 1.3**2, rel=0.01)
    assert abs(matrix[SHIFT, 1:]).max() < 1e-9 * matrix[SHIFT, SHIFT]


def test_a_blurred_edge_has_the_information_of_a_gaussian() -> None:
    # The integral of the squared derivative of a Gaussian edge is A^2 / (2 sigma sqrt(pi)).
    spread = 3.0
    bar = SurfaceProfile(np.ones(100), 0.0, 40.0, ACROSS_ROWS, spread)
    profile_slopes = gray_profile(bar).slopes[SHIFT]
    total = (profile_slopes**2).sum() * profile.STEP
    blurred = np.hypot(spread, 1 / np.sqrt(12))  # the pixel adds its own variance
    assert total == pytest.approx(2 / (2 * blurred * np.sqrt(np.pi)), rel=1e-3)


@pytest.mark.parametrize("half_width", [0.15, 0.8, 4.0])
def test_the_step_is_fine_enough(half_width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    surface = SurfaceProfile(DISC, 0.1, half_width, SLANTED, 0.4)
    coarse = information(surface, steady)
    monkeypatch.setattr(profile, "STEP", profile.STEP / 2)
    fine = information(surface, steady)
    np.testing.assert_allclose(coarse.diagonal(), fine.diagonal(), rtol=1e-3)


@pytest.mark.thorough
def test_the_most_likely_shift_of_noisy_exposures_reaches_the_limit(
    random: np.random.Generator,
) -> None:
    """Redraw the sensor's whole noise 6,000 times; 40 columns with the beam at other heights."""
    sensor = Sensor(exposure=7000.0, full_well=10_000, read_noise=10)
    surface = SurfaceProfile(DISC, 0.1, 0.8, ACROSS_ROWS)
    smooth = gray_profile(surface)
    columns, rows = 40, np.arange(9.0)
    places = 4.0 + (np.arange(columns) + 0.5) / columns - 0.5

    def mean(shift: float) -> Floats:
        offsets = rows[:, None] - places - shift
        return np.interp(offsets, smooth.offset, smooth.mean)

    variance = sensor.noise_sigma(mean(0.0)) ** 2
    trials = np.array([sensor.expose(mean(0.0), random) for _ in range(6000)], float)
    # Gray values back to radiance.
    radiance = trials * (sensor.full_well / 255) / sensor.exposure

    def estimate(image: Floats) -> float:
        def cost(shift: float) -> float:
            return float(((image - mean(shift)) ** 2 / variance).sum())

        return float(minimize_scalar(cost, bounds=(-0.05, 0.05), method="bounded").x)

    estimates = np.array([estimate(image) for image in radiance])
    matrix = columns * information(surface, lambda radiance: sensor.noise_sigma(radiance) ** 2)
    sigma = matrix[SHIFT, SHIFT] ** -0.5
    assert abs(estimates.mean()) < 5 * sigma / np.sqrt(len(estimates))
    # The standard deviation of 6,000 estimates is uncertain by 0.9 %.
    assert estimates.std() == pytest.approx(sigma, rel=0.05)
