import numpy as np
import pytest

from tests.draws import generator
from vbaa_bench.sensor.ideal import Ideal


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_gray_is_rounded_radiance_and_nothing_else(bits: int) -> None:
    radiance = generator(__name__, 0).uniform(0, 2.5, (50, 50))
    frame = Ideal(0.5, bits).expose(radiance, generator(__name__, 1), 0.1 * radiance)
    full = 2**bits - 1
    assert (frame == np.minimum(np.rint(full * 0.5 * radiance), full)).all()
    assert frame.max() == full
    assert frame.dtype == (np.uint8 if bits == 8 else np.uint16)


def test_its_noise_is_that_of_rounding(random: np.random.Generator) -> None:
    sensor = Ideal(0.5, 8)
    ramp = np.linspace(0, 2, 40_000).reshape(200, 200)
    error = sensor.expose(ramp, random) / (255 * 0.5) - ramp
    assert np.std(error) == pytest.approx(sensor.noise_sigma(ramp)[0, 0], rel=0.02)
