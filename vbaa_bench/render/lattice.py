"""Randomly shifted low-discrepancy points of the unit cube.

The Kronecker sequence: the i-th coordinate of point n is the fractional part of shift_i + n a_i,
where the a_i are badly approximable numbers. Each point is uniformly random, so a mean over points
is unbiased. The points leave few gaps, so the mean has low variance.
"""

from typing import Any, Final

import drjit as dr
import mitsuba as mi

# Step of the Fibonacci lattice.
GOLDEN: Final = 2 / (1 + 5**0.5)


def steps(dimensions: int) -> list[float]:
    """Return the steps a_i = phi^-i of the R sequence (Roberts 2018).

    In d dimensions, phi is the root of phi^(d+1) = phi + 1.
    """
    phi = 2.0
    for _ in range(50):
        phi = (1 + phi) ** (1 / (dimensions + 1))
    return [phi**-i for i in range(1, dimensions + 1)]


def pair(shift: Any, number: Any, count: Any) -> Any:
    """Return point `number` of `count` of the Fibonacci lattice, as mi.Point2f of Dr.Jit numbers.

    Its rows are regular and all its column coordinates differ. It therefore samples edges along
    either axis evenly, such as a beam along the rows of an image and its shadow across a lamp.
    """
    return _kronecker_point(shift, (GOLDEN, 1 / mi.Float(count)), number)


def _kronecker_point(shift: Any, step: tuple[Any, Any], number: Any) -> Any:
    u = mi.Point2f(*step) * mi.Point2f(number) + shift
    return u - dr.floor(u)


def point(shifts: list[Any], number: Any, count: Any) -> list[Any]:
    """Return point `number` of `count`: one pair of coordinates for each of the random `shifts`.

    The first pair is from the Fibonacci lattice, the others are from the R sequence.
    """
    first, *rest = shifts
    step = steps(2 * len(rest) + 1)
    terms = zip(rest, step[0:-1:2], step[1::2], strict=True)
    return [pair(first, number, count), *(_kronecker_point(u, (a, b), number) for u, a, b in terms)]
