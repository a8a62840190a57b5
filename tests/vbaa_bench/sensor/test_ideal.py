import numpy as np
import pytest

from vbaa_bench.sensor.ideal import Ideal


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_gray_is_rounded_radiance_and_nothing_else(bits: int) -> None:
    radiance = np.random.default_rng(0).uniform(0, 2.5, (50, 50))
    frame = Ideal(0.5, bits).expose(radiance, np.random.default_rng(1), 0.1 * radiance)
    full = 2**bits - 1
    assert (frame == np.minimum(np.rint(full * 0.5 * radiance), full)).all()
    assert frame.max() == full
    assert frame.dtype == (np.uint8 if bits == 8 else np.uint16)


def test_its_noise_is_that_of_rounding() -> None:
    sensor = Ideal(0.5, 8)
    ramp = np.linspace(0, 2, 40_000).reshape(200, 200)
    error = sensor.expose(ramp, np.random.default_rng(0)) / (255 * 0.5) - ramp
    assert np.std(error) == pytest.approx(sensor.noise_sigma(ramp)[0, 0], rel=0.02)


def test_render_noise_above_rounding_is_told() -> None:
    sensor = Ideal(1.0, 8)
    variance = np.zeros((2, 2))
    variance[0, 0] = (0.3 / 255) ** 2  # rounding: 0.289
    assert sensor.excess(np.ones((2, 2)), variance) == 0.25
