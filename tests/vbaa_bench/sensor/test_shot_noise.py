import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import poisson as exact

from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from vbaa_bench.sensor.shot_noise import MANY, poisson


class Normals:
    """Draws what it is told in place of normal numbers."""

    def __init__(self, z: float) -> None:
        self.z = z

    def standard_normal(self, shape: tuple[int, ...], dtype: type) -> np.ndarray:
        return np.full(shape, self.z, dtype)


@pytest.mark.parametrize("mean", [MANY, 100, 1000, 10_000])
def test_many_shots_have_a_poissons_quantiles(mean: float) -> None:
    # The count drawn at the quantile u of the normal number lies where the exact distribution
    # function passes u, but for its error.
    for u in np.linspace(0.0005, 0.9995, 101):
        drawn = poisson(np.full((1, 1), mean, np.float32), Normals(norm.ppf(u)))[0, 0]  # type: ignore[arg-type]
        error = 3e-4 * MANY / mean + 1e-6
        assert exact.cdf(drawn - 1, mean) - error < u < exact.cdf(drawn, mean) + error


@pytest.mark.thorough
@pytest.mark.parametrize("mean", [0.0, 0.3, 4.0, MANY - 0.1, MANY + 0.1, 900.0])
def test_mean_variance_and_skewness_are_a_poissons(
    mean: float, random: np.random.Generator
) -> None:
    counts = poisson(np.full((1000, 1000), mean, np.float32), random)
    apart = counts.astype(float) - mean
    n = counts.size
    assert (counts == np.rint(counts)).all()
    assert counts.min() >= 0
    assert apart.mean() == pytest.approx(0, abs=MOST_SIGMAS * np.sqrt(mean / n))
    assert apart.var() == pytest.approx(mean, abs=MOST_SIGMAS * np.sqrt((2 * mean**2 + mean) / n))
    # The sixth central moment is mean + 25 mean^2 + 15 mean^3.
    error = np.sqrt((mean + 24 * mean**2 + 15 * mean**3) / n)
    assert np.mean(apart**3) == pytest.approx(mean, abs=MOST_SIGMAS * error)


def test_small_counts_have_exact_probabilities() -> None:
    """At every quantile, the count is the first one whose distribution function reaches it."""
    for mean in (0.01, 1.0, 7.3, MANY - 0.01):
        for u in np.linspace(0.0005, 0.9995, 101):
            drawn = poisson(np.full((1, 1), mean, np.float32), Normals(norm.ppf(u)))[0, 0]  # type: ignore[arg-type]
            assert exact.cdf(drawn - 1, mean) - 1e-6 < u < exact.cdf(drawn, mean) + 1e-6


def test_a_pixel_does_not_change_the_others() -> None:
    mean = np.linspace(0, 2 * MANY, 600, dtype=np.float32).reshape(20, 30)
    other = mean.copy()
    other[::7, ::5] += 25  # some of them pass MANY
    one, two = (poisson(image, generator(__name__, 3)) for image in (mean, other))
    assert (one == two)[mean == other].all()
    assert (one != two).any()
