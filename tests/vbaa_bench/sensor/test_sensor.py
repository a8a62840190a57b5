import numpy as np
import pytest

from vbaa_bench.sensor.sensor import Sensor, exposure_for


def test_noise_is_that_of_shots_and_reading() -> None:
    sensor = Sensor(exposure=1.0, full_well=10_000, read_noise=10)
    for electrons in (500.0, 7000.0):
        gray = sensor.expose(np.full((400, 400), electrons), np.random.default_rng(0)).astype(float)
        per_gray = 10_000 / 255
        assert gray.mean() == pytest.approx(electrons / per_gray, rel=2e-3)
        variance = (electrons + 10**2) / per_gray**2 + 1 / 12  # shots, reading, rounding
        assert gray.var() == pytest.approx(variance, rel=0.03)


def test_the_full_well_saturates_and_darkness_is_black() -> None:
    sensor = Sensor(exposure=1.0, full_well=1000, read_noise=0)
    image = sensor.expose(np.array([[0.0, 1e6, -1.0]]), np.random.default_rng(0))
    assert image.tolist() == [[0, 255, 0]]
    assert image.dtype == np.uint8


def test_the_same_generator_gives_the_same_frame() -> None:
    sensor = Sensor(1.0, 1000, 5)
    radiance = np.full((8, 8), 300.0)
    one = sensor.expose(radiance, np.random.default_rng(3))
    assert (one == sensor.expose(radiance, np.random.default_rng(3))).all()
    assert (one != sensor.expose(radiance, np.random.default_rng(4))).any()


def test_exposure_puts_the_peak_where_it_is_asked_for() -> None:
    exposure = exposure_for(0.35, 10_000, 0.7)
    assert 0.35 * exposure == pytest.approx(7000)
    with pytest.raises(ValueError, match="peak"):
        exposure_for(0.0, 10_000, 0.7)
