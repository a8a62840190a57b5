import numpy as np
import pytest

from tests.draws import generator
from vbaa_bench.sensor.fixed_pattern import FixedPattern
from vbaa_bench.sensor.sensor import Sensor


@pytest.fixture(scope="module")
def pattern() -> FixedPattern:
    return FixedPattern.draw((70, 70), prnu=0.02, dsnu=30.0, random=generator(__name__, 5))


def mean_frame(pattern: FixedPattern, electrons: float) -> np.ndarray:
    """The mean of many frames [electrons], in which only what is fixed is left."""
    sensor = Sensor(1.0, 65_535, 5.0, bits=16, dark_signal=200.0, pattern=pattern)
    random = generator(__name__, 0)
    flat = np.full((70, 70), electrons)
    return np.asarray(np.mean([sensor.expose(flat, random) for _ in range(300)], axis=0))


def test_it_is_the_same_in_every_frame_and_of_the_stated_size(pattern: FixedPattern) -> None:
    dark, bright = mean_frame(pattern, 0.0), mean_frame(pattern, 10_000.0)
    # The mean of 300 frames is out by (225 / 300)^0.5 = 0.9 and (10225 / 300)^0.5 = 5.8 electrons.
    assert np.std(dark) == pytest.approx(30, rel=0.06)
    assert np.std(bright - dark) / 10_000 == pytest.approx(0.02, rel=0.06)
    assert dark == pytest.approx(200 + pattern.offset, abs=6)
    assert bright == pytest.approx(10_000 * pattern.response + 200 + pattern.offset, abs=40)


def test_the_same_generator_draws_the_same_pattern(pattern: FixedPattern) -> None:
    again = FixedPattern.draw((70, 70), 0.02, 30.0, generator(__name__, 5))
    assert (again.response == pattern.response).all()
    assert (again.offset == pattern.offset).all()


def test_no_pixel_answers_light_with_less_than_nothing(random: np.random.Generator) -> None:
    wild = FixedPattern.draw((200, 200), 0.5, 0.0, random)
    assert wild.response.min() == 0


def test_hot_pixels_have_the_stated_number_and_dark_signal() -> None:
    plain = FixedPattern.draw((1300, 1300), 0.0, 0.0, generator(__name__, 0))
    pattern = plain.with_defects(0.01, 400.0, 0.002, generator(__name__, 1))
    assert isinstance(pattern.hot_signal, np.ndarray)
    signal = pattern.hot_signal[pattern.hot_signal > 0]
    # Counts are Poisson; an exponential distribution has the standard deviation of its mean.
    assert signal.size == pytest.approx(16_900, abs=5 * 130)
    assert signal.mean() == pytest.approx(400, abs=5 * 400 / 130)
    assert signal.std() == pytest.approx(400, rel=0.06)
    assert np.count_nonzero(pattern.response == 0) == pytest.approx(3380, abs=5 * 58)
    assert set(np.unique(pattern.response)) == {0, 1}


def test_hot_pixels_have_the_shot_noise_of_their_dark_current_and_dead_ones_no_light(
    random: np.random.Generator,
) -> None:
    hot_signal = np.zeros((600, 800), np.float32)
    hot_signal[:, 50:] = 3000
    response = np.ones((600, 800), np.float32)
    response[:, 100:] = 0
    pattern = FixedPattern(response, np.zeros_like(response), hot_signal)
    sensor = Sensor(1.0, 65_535, 5.0, bits=16, dark_signal=200.0, pattern=pattern)
    frame = sensor.expose(np.full((600, 800), 1000.0), random).astype(float)
    plain, hot, dead = frame[:, :50], frame[:, 50:100], frame[:, 100:]
    assert plain.mean() == pytest.approx(1200, abs=5 * 35 / 173)
    assert hot.mean() == pytest.approx(4200, abs=5 * 65 / 173)
    assert hot.var() == pytest.approx(4200 + 25 + 1 / 12, rel=0.06)
    assert dead.mean() == pytest.approx(3200, abs=0.5)
