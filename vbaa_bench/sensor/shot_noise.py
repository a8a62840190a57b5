"""Shot noise: Poisson counts of electrons."""

import numpy as np

from vbaa_bench.sensor.quantise import Image

# From this mean on, counts are drawn from a transformed normal distribution.
MANY = 30


def poisson(mean: Image, random: np.random.Generator) -> Image:
    """Draw Poisson counts (h, w) of the means (h, w).

    They are exact below MANY. Above, in half the time, they follow the Cornish-Fisher expansion of
    the Poisson quantiles with skewness, rounded to whole counts. Mean and variance are exact; the
    error of the distribution function is at most 3e-4 at MANY, and 0.01 / mean above.
    """
    counts = np.empty_like(mean)
    small = mean < MANY
    counts[small] = random.poisson(mean[small])
    large = mean[~small]
    z = random.standard_normal(large.shape, dtype=np.float32)
    # Rounding adds 1/12 to the variance and the square 1/18, together 5/36.
    counts[~small] = np.rint(large + np.sqrt(large - 5 / 36) * z + (z * z - 1) / 6)
    return counts
