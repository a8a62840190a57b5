"""Evenly spread points of the unit cube, randomly shifted.

The Kronecker sequence: of point n the i-th coordinate is the fractional part of shift_i + n a_i,
where the a_i are badly approximated by fractions. Every point by itself is uniformly random, so a
mean over points is unbiased; together they leave few holes, so it has little noise.
"""

from typing import Any

import drjit as dr
import mitsuba as mi

_GOLDEN = 2 / (1 + 5**0.5)


def steps(dimensions: int) -> list[float]:
    """Steps a_i = phi^-i of the R sequence (Roberts 2018): phi^(d+1) = phi + 1, in d dimensions."""
    phi = 2.0
    for _ in range(50):
        phi = (1 + phi) ** (1 / (dimensions + 1))
    return [phi**-i for i in range(1, dimensions + 1)]


def pair(shift: Any, number: Any, count: Any) -> Any:
    """Point `number` of `count` of Fibonacci's lattice, as mi.Point2f; all Dr.Jit numbers.

    It has regular rows, and no column is like another: what runs along the one or the other, as a
    beam does along the rows of an image and its shadow across a lamp, is cut most evenly.
    """
    return _place(shift, (_GOLDEN, 1 / mi.Float(count)), number)


def _place(shift: Any, step: tuple[Any, Any], number: Any) -> Any:
    u = mi.Point2f(*step) * mi.Point2f(number) + shift
    return u - dr.floor(u)


def point(shifts: list[Any], number: Any, count: Any) -> list[Any]:
    """Point `number` of `count`: as many pairs of coordinates as there are random `shifts`.

    The first pair is Fibonacci's lattice, the others follow the R sequence.
    """
    first, *others = shifts
    step = steps(2 * len(others) + 1)
    following = zip(others, step[0:-1:2], step[1::2], strict=True)
    return [pair(first, number, count), *(_place(u, (a, b), number) for u, a, b in following)]
