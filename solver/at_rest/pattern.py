"""What the beam at rest shows beside its smooth course: a pattern that may belong to the beam.

Smudges, dust and worn paint move the apparent middle of the beam by as much when it is bent as at
rest, at the same arc length. Light, the ground and the pixel grid leave such errors, too, which do
not follow the beam. Every bent image shows which part of the pattern does.
"""

from typing import Final

import numpy as np

from solver.instrument.arrays import Floats

# Places along the beam, and the sigma of the Gaussian mean about each, over the length. Chosen: a
# mean of an eighth of the noise, which resolves smudges of a thirtieth of the length.
NODES: Final = 201
SPREAD: Final = 1 / 100
# Mean square of the pattern, in variances of its noise, below which it is noise. Derived: with 28
# independent places, noise alone reaches it once in seven hundred.
MIN_CHI2: Final = 2.0
# Distance, over the length, of the places that a place is compared with. Chosen: three and a half
# times the spread, across which the smooth course of a bent beam leaves little of its own.
LAG: Final = 0.035
# Significance, in sigmas, of a pattern that is subtracted. Chosen: noise has it once in a thousand.
MIN_SIGNIFICANCE: Final = 3.0


def pattern_of(x: Floats, residual: Floats, sigma: Floats, random: float) -> Floats:
    """Average what a fit of the beam at rest leaves, at NODES places from the clamp to the tip.

    `x` (n,) are the points' distances from the clamp over the length, in order, `residual` (n,) [m]
    their deviations from the course, and `sigma` (n,) [m] the noise of each in one image, of whose
    variance the part `random` is left. Empty where the averages are noise, or so small that the
    noise of one image would hide them; 0 at places without points.
    """
    nodes = np.linspace(0.0, 1.0, NODES)
    weight = np.exp(-(((x - nodes[:, None]) / SPREAD) ** 2) / 2) / sigma**2
    total = weight.sum(axis=1)
    seen = total > weight.max() / 2
    mean = weight[seen] @ residual / total[seen]
    variance = random * (weight[seen] ** 2 @ sigma**2) / total[seen] ** 2
    pattern = np.zeros(NODES)
    pattern[seen] = mean
    shown = np.interp(x, nodes, pattern)
    more_than_noise = mean @ mean > MIN_CHI2 * variance.sum()
    if more_than_noise and share_that_follows(x, shown, shown, sigma):
        return pattern
    return np.empty(0)


def share_that_follows(arc: Floats, pattern: Floats, beside: Floats, sigma: Floats) -> float:
    """Estimate the part of a pattern that a bent beam shows at the same arc lengths, from 0 to 1.

    `arc` (n,) is over the length, in order from the clamp; the `pattern` (n,), the deviations
    `beside` a smooth course (n,) and their noise `sigma` (n,) are along the normals. Both are
    compared by their second differences, to which a course that bends slowly adds little. A part
    that may be noise is 0, and so is that of a pattern that the image's noise would hide.
    """
    lag = round(LAG * len(arc) / max(arc[-1] - arc[0], LAG)) if len(arc) else 0
    if lag < 1 or len(arc) <= 2 * lag:
        return 0.0
    difference = pattern[lag:-lag] - (pattern[: -2 * lag] + pattern[2 * lag :]) / 2
    # The transposed differences of these: its products with values are those of the differences.
    twice = np.zeros_like(pattern)
    twice[lag:-lag] += difference
    twice[: -2 * lag] -= difference / 2
    twice[2 * lag :] -= difference / 2
    whole, product = float(difference @ difference), float(twice @ beside)
    least = MIN_SIGNIFICANCE * float(np.sqrt(twice**2 @ sigma**2))
    return min(product / whole, 1.0) if min(whole, product) > least else 0.0
