"""Edges of printed cells in the pixels of an image, and samples that are stratified by them."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply
from vbaa_bench.render.device_array import device_array, index_of
from vbaa_bench.render.pixel_strata import PixelStrata, pixel_strata

# Points of an edge that are projected; the image of the edge is straight between them.
_POINTS = 200


class _Edge(NamedTuple):
    """An edge from `start` to `end`, (2,) each, of which the parts between `ends` are `printed`.

    `ends` (n + 1,) are coordinates along it, `printed` (n,) says where the colour changes.
    """

    start: Floats
    end: Floats
    ends: Floats
    printed: Mask


@dataclass(frozen=True)
class PrintedEdges:
    """The edge in each pixel of an image (height, width) of printed cells.

    `sides` (2, height, width) are the edge's places [px] across the pixel, where it enters and
    leaves it: columns of an `upright` edge at the upper and lower side of the pixel, else rows at
    its left and right side. They are -1 in pixels without an edge, and with more than one.
    """

    sides: Floats
    upright: Mask

    @classmethod
    def of(
        cls, x: Floats, y: Floats, black: Mask, frame_from_board: Floats, camera: Camera
    ) -> Self:
        """Project the edges of cells between increasing `x` and `y` [m], `black` from the top."""
        shape = (camera.height, camera.width)
        sides, upright, count = np.full((2, *shape), -1.0), np.zeros(shape, bool), np.zeros(shape)
        for edge in _edges(x, y, black):
            part = np.linspace(0, 1, _POINTS)
            points = edge.start + part[:, None] * (edge.end - edge.start)
            points = np.column_stack([points, np.zeros(_POINTS)])
            pixels = camera.project(apply(frame_from_board, points)) + 0.5
            is_upright = bool(np.ptp(pixels[:, 1]) > np.ptp(pixels[:, 0]))
            across, along = pixels.T if is_upright else pixels.T[::-1]
            places = edge.ends[0] + part * (edge.ends[-1] - edge.ends[0])
            if along[-1] < along[0]:
                across, along, places = across[::-1], along[::-1], places[::-1]
            if not (np.diff(along) > 0).all():
                continue
            length, width = shape if is_upright else shape[::-1]
            lines = np.arange(max(np.ceil(along[0]), 0), min(np.floor(along[-1]), length) + 1)
            if len(lines) < 2:
                continue
            meets, place = np.interp(lines, along, across), np.interp(lines, along, places)
            cell = np.clip(np.searchsorted(edge.ends, place) - 1, 0, len(edge.printed) - 1)
            one = (cell[1:] == cell[:-1]) & edge.printed[cell[1:]]
            pixel, enters, leaves = lines[:-1][one].astype(int), meets[:-1][one], meets[1:][one]
            first, last = (
                np.floor(f(enters, leaves)).astype(int) for f in (np.minimum, np.maximum)
            )
            for step in range(int((last - first).max(initial=-1)) + 1):
                inside = (first + step <= last) & (first + step >= 0) & (first + step < width)
                index = pixel[inside], (first + step)[inside]
                index = index if is_upright else index[::-1]
                count[index] += 1
                upright[index] = is_upright
                sides[0][index], sides[1][index] = enters[inside], leaves[inside]
        return cls(np.where(count == 1, sides, -1.0), upright)

    @cached_property
    def arrays(self) -> list[Any]:
        """Sides and direction of every pixel, as Dr.Jit arrays."""
        return [device_array(image) for image in (*self.sides, self.upright.astype(float))]

    def strata(self, column: Any, row: Any, count: Any) -> PixelStrata:
        """Stratify `count` samples of pixels (Dr.Jit: column, row and count)."""
        height, width = self.upright.shape
        index = index_of(row, height) * width + index_of(column, width)
        enters, leaves, upright = (dr.gather(mi.Float, image, index) for image in self.arrays)
        is_upright = upright > 0
        origin = dr.select(is_upright, column, row)
        has = enters >= 0
        before = mi.Float(-1)
        edges = [before, dr.select(has, enters - origin, -1)]
        edges += [before, dr.select(has, leaves - origin, -1)]
        return pixel_strata(edges, is_upright, count)


def _edges(x: Floats, y: Floats, black: Mask) -> Iterator[_Edge]:
    """Yield the lines between columns and between rows of cells."""
    # Outside of the card there is neither black nor white.
    colour = np.pad(black[::-1].astype(int), 1, constant_values=2)  # rows by increasing y
    for i, place in enumerate(x):
        changes = colour[1:-1, i] != colour[1:-1, i + 1]
        yield _Edge(np.array([place, y[0]]), np.array([place, y[-1]]), y, changes)
    for j, place in enumerate(y):
        changes = colour[j, 1:-1] != colour[j + 1, 1:-1]
        yield _Edge(np.array([x[0], place]), np.array([x[-1], place]), x, changes)
