"""Shot noise: how many electrons a pixel counts where so many are expected."""

import numpy as np

from vbaa_bench.sensor.quantise import Image

# From so many on, counts are drawn from the normal distribution bent into a Poisson's shape.
MANY = 30


def poisson(mean: Image, random: np.random.Generator) -> Image:
    """Poisson counts (h, w) of the means (h, w).

    Exact below MANY. Above, in half the time: the Cornish-Fisher expansion of a Poisson's
    quantiles, with its skewness, rounded to whole counts. Mean and variance are exact; the
    distribution function is out by at most 3e-4 at MANY, and by 0.01 / mean further up.
    """
    counts = np.empty_like(mean)
    few = mean < MANY
    counts[few] = random.poisson(mean[few])
    many = mean[~few]
    z = random.standard_normal(many.shape, dtype=np.float32)
    # Rounding adds 1/12 to the variance and the square 1/18, together 5/36.
    counts[~few] = np.rint(many + np.sqrt(many - 5 / 36) * z + (z * z - 1) / 6)
    return counts
