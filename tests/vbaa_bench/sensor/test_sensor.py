import numpy as np
import pytest

from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from vbaa_bench.sensor.sensor import Sensor


def flat(value: float, side: int = 400) -> np.ndarray:
    return np.full((side, side), value)


def test_noise_is_that_of_shots_and_reading() -> None:
    sensor = Sensor(exposure=1.0, full_well=10_000, read_noise=10)
    for electrons in (500.0, 7000.0):
        gray = sensor.expose(flat(electrons), generator(__name__, 0)).astype(float)
        per_gray = 10_000 / 255
        assert gray.mean() == pytest.approx(electrons / per_gray, rel=2e-3)
        variance = (electrons + 10**2) / per_gray**2 + 1 / 12  # shots, reading, rounding
        assert gray.var() == pytest.approx(variance, rel=0.03)


def test_the_photon_transfer_curve_gives_the_gain_back() -> None:
    sensor = Sensor(2.0, 20_000, 8, quantum_efficiency=0.5, bits=12, gain=4.0, black_level=64)
    levels = np.linspace(10, 12_000, 12)
    frames = [sensor.expose(flat(e, 800), generator(__name__, i)) for i, e in enumerate(levels)]
    means, variances = np.mean(frames, axis=(1, 2)), np.var(frames, axis=(1, 2))
    slope, _ = np.polyfit(means, variances, 1)
    assert slope == pytest.approx(1 / 4.0, rel=0.01)
    assert means == pytest.approx(64 + levels / 4.0, rel=1e-3)
    read = variances[0] - 10 / 4**2 - 1 / 12
    assert np.sqrt(read) * 4 == pytest.approx(8, rel=0.03)


def test_dark_current_is_a_signal_with_its_own_shots(random: np.random.Generator) -> None:
    dark = Sensor(1.0, 65_535, 0, dark_signal=100.0, bits=16).expose(flat(0.0), random)
    error = np.sqrt(100 / dark.size)
    assert dark.mean() == pytest.approx(100, abs=MOST_SIGMAS * error)
    assert dark.var() == pytest.approx(100, rel=0.02)


def test_gamma_is_undone_by_its_power(random: np.random.Generator) -> None:
    sensor = Sensor(1.0, 1e6, 0, bits=16, gamma=2.2, black_level=500)
    electrons = np.linspace(1e4, 9e5, 360_000).reshape(600, 600)
    gray = sensor.expose(electrons, random) / 65_535
    back = (gray**2.2 * 65_535 - 500) * 1e6 / (65_535 - 500)
    error = (back - electrons) / sensor.noise_sigma(electrons)
    assert error.mean() == pytest.approx(0, abs=0.01)
    assert error.std() == pytest.approx(1, rel=0.01)


@pytest.mark.parametrize("gamma", [1.0, 2.2])
@pytest.mark.parametrize("bits", [8, 12])
def test_the_stated_noise_is_what_frames_show(bits: int, gamma: float) -> None:
    sensor = Sensor(1e4, 10_000, 10, 0.6, dark_signal=50.0, bits=bits, gamma=gamma)
    radiance = flat(0.7)
    stated = sensor.noise_sigma(radiance)[0, 0]
    # What a gray value is in radiance: the slope between two other exposures.
    low, high = (sensor.expose(flat(r, 1000), generator(__name__, 2)).mean() for r in (0.6, 0.8))
    frame = sensor.expose(radiance, generator(__name__, 1))
    assert frame.std() * 0.2 / (high - low) == pytest.approx(stated, rel=0.03)


def test_the_full_well_saturates_and_darkness_is_black(random: np.random.Generator) -> None:
    sensor = Sensor(exposure=1.0, full_well=1000, read_noise=0)
    image = sensor.expose(np.array([[0.0, 1e6, -1.0]]), random)
    assert image.tolist() == [[0, 255, 0]]
    assert image.dtype == np.uint8


def test_the_well_is_full_below_full_scale_or_above(random: np.random.Generator) -> None:
    bright = np.full((1, 3), 1e6)
    below = Sensor(1.0, 1000, 0, bits=12, gain=0.5, black_level=20).expose(bright, random)
    assert below.tolist() == [[2020] * 3]
    above = Sensor(1.0, 10_000, 0, bits=12, gain=2.0).expose(bright, random)
    assert above.tolist() == [[4095] * 3]
    well = Sensor(1.0, 10_000, 0, bits=12, black_level=100).expose(bright, random)
    assert well.tolist() == [[4095] * 3]


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_full_scale_is_that_of_the_bits(bits: int, random: np.random.Generator) -> None:
    sensor = Sensor(1.0, 1e8, 0, bits=bits)
    part, full = sensor.expose(np.array([[0.498e8, 2e8]]), random)[0]
    assert full == 2**bits - 1
    assert part / full == pytest.approx(0.498, abs=0.004)


def test_the_same_generator_gives_the_same_frame() -> None:
    sensor = Sensor(1.0, 1000, 5)
    radiance = np.full((8, 8), 300.0)
    one = sensor.expose(radiance, generator(__name__, 3))
    assert (one == sensor.expose(radiance, generator(__name__, 3))).all()
    assert (one != sensor.expose(radiance, generator(__name__, 4))).any()


# Electrons of light, and what share of their shot noise the renderer has made already.
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("electrons", "share"),
    [(e, s) for e in (25.0, 400.0, 9000.0) for s in (0.0, 0.3, 0.9)] + [(25.0, 1.1), (400.0, 1.1)],
)
def test_a_noisy_render_and_the_sensor_make_the_stated_noise_together(
    electrons: float, share: float, random: np.random.Generator
) -> None:
    sensor = Sensor(20.0, 20_000, 12, 0.5, dark_signal=4.0, bits=16, gain=0.3, black_level=500)
    sigma = np.sqrt(share * electrons) / 10  # radiance
    rendered = electrons / 10 + sigma * random.standard_normal((1000, 1000))
    frame = sensor.expose(rendered, random, np.full(rendered.shape, sigma**2))
    seen = (0.3 * (frame - 500.0) - 4.0) / 10
    stated = sensor.noise_sigma(flat(electrons / 10, 1))[0, 0]
    # A mean is sure to sigma / 1000, a variance to 2^0.5 / 1000; 5.5 times that is allowed.
    assert seen.mean() == pytest.approx(electrons / 10, abs=5.5 * stated / 1000)
    assert seen.var() == pytest.approx(stated**2, rel=5.5 * np.sqrt(2) / 1000)


def test_only_noisy_parts_of_a_render_get_less_noise(random: np.random.Generator) -> None:
    sensor = Sensor(1.0, 10_000, 0, bits=16)
    variance = flat(0.0)
    variance[:, 200:] = 2000
    frame = sensor.expose(flat(2000.0), random, variance)
    electrons = frame * (10_000 / 65_535)
    assert electrons[:, :200].var() == pytest.approx(2000, rel=0.03)
    assert electrons[:, 200:] == pytest.approx(2000, abs=0.1)
