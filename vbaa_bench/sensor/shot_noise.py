"""Shot noise: Poisson counts of electrons."""

import numpy as np
from scipy.special import ndtr

from vbaa_bench.sensor.quantise import Image

# From this mean on, counts are a transformed normal deviate.
MANY = 30
# Largest count below MANY that has a probability above 1e-20.
_LARGEST = 110


def poisson(mean: Image, random: np.random.Generator) -> Image:
    """Draw Poisson counts (h, w) of the means (h, w).

    Each pixel has one normal deviate, whatever the means are: where a mean differs by rounding,
    as on another processor, the other pixels keep their counts. Below MANY the counts are exact:
    quantiles of the Poisson distribution. Above, they follow the Cornish-Fisher expansion of these
    quantiles with skewness, rounded to whole counts. Mean and variance are exact; the error of the
    distribution function is at most 3e-4 at MANY, and 0.01 / mean above.
    """
    z = random.standard_normal(mean.shape, dtype=np.float32)
    # Rounding adds 1/12 to the variance and the square 1/18, together 5/36.
    large = np.maximum(mean, MANY)
    counts = np.rint(large + np.sqrt(large - 5 / 36) * z + (z * z - 1) / 6)
    small = mean < MANY
    counts[small] = _quantiles(mean[small].astype(np.float64), ndtr(z[small].astype(np.float64)))
    return np.asarray(counts, np.float32)


def _quantiles(mean: np.ndarray, probability: np.ndarray) -> np.ndarray:
    """Compute the Poisson quantiles (n,) of means (n,) below MANY by adding up probabilities."""
    counts, term = np.zeros(mean.shape), np.exp(-mean)
    remaining = probability - term
    active = np.flatnonzero(remaining > 0)
    for count in range(1, _LARGEST):
        if not len(active):
            break
        counts[active] = count
        term[active] *= mean[active] / count
        remaining[active] -= term[active]
        active = active[remaining[active] > 0]
    return counts
