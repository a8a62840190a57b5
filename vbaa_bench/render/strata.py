"""Samples of the unit square that are stratified by a region in it.

With samples anywhere in the square, the number that meets the region varies, and with it the mean.
Here a fixed number of the samples is inside the region and the others are outside. On both sides
they have the density of the area, as far as it is known, and weights for the rest. The mean is
unbiased whatever the region is; the variance is small if the region is right.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

# Part of the density that is even along the square. Chosen: small; without it, what the region has
# between two knots outside of it would never be sampled.
_EVEN = 0.05


class Overlap(NamedTuple):
    """The region's part of a line across the square (Dr.Jit): its lower edge and length, 0 to 1."""

    lower: Any
    length: Any


class Place(NamedTuple):
    """A place (x, y) in the square, from 0 to 1 (Dr.Jit), and the weight of its sample."""

    point: Any
    weight: Any


@dataclass  # not frozen: the loops of Dr.Jit assign to the fields
class Strata(ABC):
    """A region in every lane's square, and how many of its samples are inside (Dr.Jit).

    `share` is the fraction of the samples that are inside. `knots` are the lengths of the region in
    lines across the square, evenly spaced from its start to its end. Where `is_partly` is false,
    samples are not stratified. Lines across the square are columns, or rows where `upright`.
    """

    share: Any
    is_partly: Any
    knots: list[Any]
    upright: Any

    @abstractmethod
    def overlap(self, along: Any) -> Overlap:
        """Compute the region's part of the line at a place along the square, from 0 to 1."""


def whole_share(share: Any, count: Any) -> Any:
    """Round a fraction of `count` samples to a whole number of samples on both sides.

    The lattice has `count` evenly spaced values of y: a whole number of them is inside.
    """
    number = mi.Float(count)
    return dr.clip(dr.round(share * number), 1, number - 1) / number


def place(strata: Strata | None, u: Any) -> Place:
    """Map a lattice point `u` of the unit square to a stratified place."""
    if strata is None:
        return Place(u, mi.Float(1))
    share, is_inside = strata.share, u.y < strata.share
    along, density = _along(
        [dr.select(is_inside, length, 1 - length) for length in strata.knots], u.x
    )
    along = dr.select(strata.is_partly, along, u.x)
    lower, covered = strata.overlap(along)
    inside = lower + _folded(u.y / share) * covered
    outside = _folded((u.y - share) / (1 - share)) * (1 - covered)
    outside = dr.select(outside < lower, outside, outside + covered)
    weight = dr.select(is_inside, covered / share, (1 - covered) / (1 - share)) / density
    across = dr.select(is_inside, inside, outside)
    across = dr.select(strata.is_partly, across, _folded(u.y))
    point = dr.select(strata.upright, mi.Point2f(across, along), mi.Point2f(along, across))
    return Place(point, dr.select(strata.is_partly, weight, 1))


class _Along(NamedTuple):
    """A place along the square, from 0 to 1 (Dr.Jit), and the density of places there."""

    place: Any
    density: Any


def _along(lengths: Sequence[Any], u: Any) -> _Along:
    """Map an even `u` to places whose density is linear between knots of given lengths."""
    mean = sum(lengths, mi.Float(0)) / len(lengths)
    knots = [length + _EVEN * mean for length in lengths]
    areas = [(left + right) / 2 for left, right in pairwise(knots)]
    total = sum(areas, mi.Float(0))
    rest, number = u * total, mi.Float(0)
    left, right, area = knots[0], knots[1], areas[0]
    for next_number in range(1, len(areas)):
        beyond = (rest >= area) & (number == next_number - 1)
        rest = dr.select(beyond, rest - area, rest)
        number = dr.select(beyond, next_number, number)
        left = dr.select(beyond, knots[next_number], left)
        right = dr.select(beyond, knots[next_number + 1], right)
        area = dr.select(beyond, areas[next_number], area)
    part = dr.clip(rest / area, 0, 1)
    # The inverse of the integral of a linear density.
    root = dr.sqrt(dr.lerp(left**2, right**2, part))
    within = part * (left + right) / (left + root)
    return _Along((number + within) / len(areas), dr.lerp(left, right, within) * len(areas) / total)


def _folded(u: Any) -> Any:
    """Fold the unit interval, so that a lattice integrates smooth functions better.

    The values at both ends then meet, as if the function were periodic (Hickernell 2002).
    """
    return 1 - dr.abs(2 * u - 1)
