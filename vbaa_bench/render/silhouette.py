"""The beam's silhouette in every pixel column, and samples that are stratified by it.

A beam covers part of a pixel. With samples anywhere in the pixel, the number that meets the beam
varies, and with it the pixel's value. Here a fixed number of the samples is inside the silhouette
and the others are outside, each weighted by its part of the area. The mean is unbiased whatever the
silhouette is; the variance is small if the silhouette is right.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera

# The mesh's edges are straight between rings, in space but not through a distorting lens, and are
# rounded to single precision: they depart from the silhouette by less. Chosen; where they depart by
# more, a pixel beside the beam has more noise.
_MARGIN_PX = 0.02
# Range of the fraction of a partly covered pixel's samples that are inside the silhouette. Chosen:
# neither the beam nor the background is left to a few samples.
_MIN_INSIDE, _MAX_INSIDE = 0.25, 0.75


@dataclass(frozen=True)
class Silhouette:
    """Edges of the beam in an image of `shape` (height, width), in pixels from its corner.

    `edges` (4, n) holds, for every pixel column, the lower and the upper edge at its left side,
    then both at its right side; all are 0 where the column does not show the beam. With `upright`
    it holds the same for pixel rows, with x and y exchanged. The beam ends within the columns of
    `ends` (n,), whose samples are not stratified.
    """

    edges: Floats
    ends: Mask
    upright: bool
    shape: tuple[int, int]

    @classmethod
    def of(cls, rings: Floats, camera: Camera) -> Self | None:
        """Project a beam's rings of vertices (m, facets, 3) [m] in Sigma_a.

        Return None if the beam turns back in the image, so that a column shows it twice.
        """
        pixels = camera.project(rings.reshape(-1, 3)).reshape(*rings.shape[:2], 2) + 0.5
        middle, shape = pixels.mean(axis=1), (camera.height, camera.width)
        upright = bool(np.ptp(middle[:, 1]) > np.ptp(middle[:, 0]))
        along, across = (1, 0) if upright else (0, 1)
        if middle[-1, along] < middle[0, along]:
            pixels = pixels[::-1]
        sides = np.arange(shape[0 if upright else 1] + 1.0)
        lines = []
        for extreme in (pixels[..., across].argmin(axis=1), pixels[..., across].argmax(axis=1)):
            outline = pixels[np.arange(len(pixels)), extreme]
            if not (np.diff(outline[:, along]) > 0).all():
                return None
            lines.append(np.interp(sides, outline[:, along], outline[:, across]))
        lower, upper = lines
        edges = np.array([lower[:-1], upper[:-1], lower[1:], upper[1:]])
        first, last = pixels[0, :, along], pixels[-1, :, along]
        edges[:, (sides[1:] <= first.min()) | (sides[:-1] >= last.max())] = 0.0
        ends = (sides[:-1] < first.max()) | (sides[1:] > last.min())
        return cls(edges, ends, upright, shape)

    @property
    def touched(self) -> Mask:
        """Pixels (height, width) that the silhouette touches, up to rounding."""
        lower, upper = self.edges[::2].min(axis=0), self.edges[1::2].max(axis=0)
        place = np.arange(self.shape[1 if self.upright else 0])[:, None]
        touched = (place + 1 > lower - _MARGIN_PX) & (place < upper + _MARGIN_PX) & (upper > lower)
        return np.asarray(touched.T if self.upright else touched)

    def strata(self, column: Any, row: Any) -> "Strata":
        """Look up the edges for pixels (Dr.Jit floats: column and row), relative to each pixel."""
        index, origin = (row, column) if self.upright else (column, row)
        lines = (
            dr.gather(mi.Float, mi.Float(edge.astype(np.float32)), mi.UInt32(index)) - origin
            for edge in np.where(self.ends, 0.0, self.edges)
        )
        lower_left, upper_left, lower_right, upper_right = lines
        return Strata(lower_left, upper_left, lower_right, upper_right, self.upright)


@dataclass  # not frozen: the loops of Dr.Jit assign to the fields
class Strata:
    """Edges of the silhouette relative to each pixel (Dr.Jit): lower and upper, left and right."""

    lower_left: Any
    upper_left: Any
    lower_right: Any
    upper_right: Any
    upright: bool

    def overlap(self, along: Any) -> "Overlap":
        """Compute the covered part of the pixel at a place along it, from 0 to 1."""
        lower = dr.clip(dr.lerp(self.lower_left, self.lower_right, along), 0, 1)
        upper = dr.clip(dr.lerp(self.upper_left, self.upper_right, along), 0, 1)
        return Overlap(lower, dr.maximum(upper - lower, 0))


class Overlap(NamedTuple):
    """The covered part of a line across a pixel (Dr.Jit): its lower edge and length, 0 to 1."""

    lower: Any
    length: Any


class Place(NamedTuple):
    """A place (x, y) in a pixel, from 0 to 1 (Dr.Jit), and the weight of its sample."""

    point: Any
    weight: Any


def stratum(strata: Strata | None, u: Any, count: Any) -> Place:
    """Map one of `count` lattice points `u` of the unit square to a place in the pixel."""
    if strata is None:
        return Place(u, mi.Float(1))
    along, across = u.x, u.y
    mean = sum((strata.overlap(mi.Float(t)).length for t in (0.0, 0.5, 1.0)), mi.Float(0)) / 3
    # The lattice has `count` evenly spaced values of y: a whole number of them is inside.
    number = mi.Float(count)
    inside = dr.clip(dr.round(dr.clip(mean, _MIN_INSIDE, _MAX_INSIDE) * number), 1, number - 1)
    inside /= number
    lower, covered = strata.overlap(along)
    is_inside = across < inside
    outside = _folded((across - inside) / (1 - inside)) * (1 - covered)
    outside = dr.select(outside < lower, outside, outside + covered)
    place = dr.select(is_inside, lower + _folded(across / inside) * covered, outside)
    weight = dr.select(is_inside, covered / inside, (1 - covered) / (1 - inside))
    is_partly = (mean > 0) & (mean < 1) & (count > 1)
    place = dr.select(is_partly, place, _folded(across))
    point = mi.Point2f(place, along) if strata.upright else mi.Point2f(along, place)
    return Place(point, dr.select(is_partly, weight, 1))


def _folded(u: Any) -> Any:
    """Fold the unit interval, so that a lattice integrates smooth functions better.

    The values at both ends then meet, as if the function were periodic (Hickernell 2002).
    """
    return 1 - dr.abs(2 * u - 1)
