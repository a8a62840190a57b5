"""What a pixel shows of a straight edge that the lens blurs: an average over the pixel's width."""

import math

from solver.instrument.compiled import njit


@njit
def blurred_edge(t: float, blur: float) -> tuple[float, float]:
    """Compute the part of a pixel at t [px] beyond an edge, and its derivative by t.

    `blur` [px] is the sigma of the edge's image, above 0.
    """
    if t > 0.5 + 5 * blur:
        return 1.0, 0.0
    if t < -0.5 - 5 * blur:
        return 0.0, 0.0
    above, below = (t + 0.5) / blur, (t - 0.5) / blur
    past_above, past_below = _normal(above), _normal(below)
    density = math.exp(-0.5 * above * above) - math.exp(-0.5 * below * below)
    part = blur * (above * past_above - below * past_below + density / math.sqrt(2 * math.pi))
    return part, past_above - past_below


@njit(inline="always")
def _normal(z: float) -> float:
    """Evaluate the normal distribution's cumulative function."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
