"""The strip of a lamp that the beam hides from a point.

In its penumbra, the beam hides a narrow strip of a lamp, which few of evenly spread samples meet.
Samples that are stratified by this strip measure the shadow with less noise.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.device_array import device_array, index_of
from vbaa_bench.render.strata import Overlap, Strata, whole_share

# Rows of the table of the beam's centreline, which is taken as straight within a row.
_ROWS = 512
# Fraction of the samples in the strip, at least one. Measured: one of four suffices for the shadow
# of a thin beam; the others serve the shadows of other surfaces.
_INSIDE = 0.125
# Factor of the beam's radius. Chosen: a sample that the beam hides although it is outside the strip
# is rare and has a large weight.
_MARGIN = 1.004
# Places along the lamp at which the hidden length across it is computed.
_KNOTS = (0.0, 0.25, 0.5, 0.75, 1.0)


class BeamAlongLamp(NamedTuple):
    """A beam along a lamp, in the lamp's own frame and in evenly spaced places x (Dr.Jit).

    `ends` (2,) holds x of the first and of the last end, `heights` (2,) the mean and smallest z.
    `y`, `z`, `slope_y`, `slope_z` (their derivatives by x) and `radius` have one value per place.
    """

    ends: Any
    heights: Any
    y: Any
    z: Any
    slope_y: Any
    slope_z: Any
    radius: Any


class HiddenStrip:  # not a dataclass: the loops of Dr.Jit would take its table for their state
    """What a beam hides of a rectangular lamp, seen from any point; in render coordinates.

    The lamp's own frame has its origin in the lamp's middle, x along the side that the beam follows
    most, y along the other side, and z away from the lamp. `axes` (3, 3) holds its axes as rows,
    `middle` (3,) its origin, `half_sides` those in x and y. With `upright`, x is along the second
    coordinate of Mitsuba's rectangle.
    """

    def __init__(
        self,
        axes: Floats,
        middle: Floats,
        half_sides: tuple[float, float],
        upright: bool,
        beam: BeamAlongLamp,
    ) -> None:
        self.axes, self.middle, self.half_sides = axes, middle, half_sides
        self.upright, self.beam = upright, beam

    @classmethod
    def of(cls, rings: Floats, pose: Floats) -> Self | None:
        """Describe a beam's rings of vertices (n, facets, 3), and a rectangle in a pose (4, 4).

        Return None if the beam turns back along the lamp, or passes through its plane.
        """
        line = rings.mean(axis=1)
        radius = np.linalg.norm(rings - line[:, None], axis=2).max(axis=1)
        lengths = np.linalg.norm(pose[:3, :3], axis=0)
        axes, middle = (pose[:3, :3] / lengths).T, pose[:3, 3]
        extent = np.ptp(line @ axes.T, axis=0)
        order = [1, 0, 2] if extent[1] > extent[0] else [0, 1, 2]
        x, y, z = ((line - middle) @ axes[order].T).T
        if x[-1] < x[0]:
            x, y, z, radius = x[::-1], y[::-1], z[::-1], radius[::-1]
        if not (np.diff(x) > 0).all() or z.min() <= 0:
            return None
        places = np.linspace(x[0], x[-1], _ROWS)
        table = [np.interp(places, x, values) for values in (y, z, radius)]
        slopes = [np.append(np.diff(values), 0) / (places[1] - places[0]) for values in table[:2]]
        ends, heights = x[[0, -1]], np.array([z.mean(), z.min()])
        beam = BeamAlongLamp(*map(device_array, (ends, heights, *table[:2], *slopes, table[2])))
        half_sides = float(lengths[order[0]]), float(lengths[order[1]])
        return cls(axes[order], middle, half_sides, order[0] == 1, beam)

    @property
    def state(self) -> Any:
        """All that a frozen function depends on and that may change."""
        return self.upright, tuple(self.beam)

    def strata(self, point: Any, count: Any) -> "LampStrata":
        """Stratify `count` samples of the lamp, seen from points (Dr.Jit)."""
        middle = mi.Vector3f(*self.middle.tolist())
        seen_from = mi.Point3f(
            *(dr.dot(point - middle, mi.Vector3f(*axis)) for axis in self.axes.tolist())
        )
        knots = [self.overlap(seen_from, mi.Float(t)).length for t in _KNOTS]
        mean = sum(knots, mi.Float(0)) / len(knots)
        share = whole_share(mi.Float(_INSIDE), count)
        is_partly = (mean > 0) & (mean < 1) & (count > 1)
        return LampStrata(share, is_partly, knots, mi.Bool(self.upright), seen_from, self)

    def overlap(self, seen_from: Any, along: Any) -> Overlap:
        """Compute the hidden part of a line across the lamp, seen from a point in its frame."""
        beam, (length, width) = self.beam, self.half_sides
        first, last = (dr.gather(mi.Float, beam.ends, mi.UInt32(i)) for i in range(2))
        height, nearest = (dr.gather(mi.Float, beam.heights, mi.UInt32(i)) for i in range(2))
        # The beam hides nothing from points that are nearer to the lamp than all of the beam. Some
        # are on the lamp, if the camera sees it: their distance 0 must not be divided by.
        away = dr.maximum(seen_from.z, nearest)
        side = (2 * along - 1) * length - seen_from.x
        # Where the plane through the point and the line meets the beam, from its mean height.
        x = seen_from.x + side * (1 - height / away)
        for _ in range(2):
            row = index_of((x - first) / (last - first) * (_ROWS - 1), _ROWS)
            place = dr.lerp(first, last, mi.Float(row) / (_ROWS - 1))
            slope_z = dr.gather(mi.Float, beam.slope_z, row)
            z = dr.gather(mi.Float, beam.z, row)
            # Infinite or NaN where the line of sight is parallel to the beam and never meets it.
            step = (seen_from.x + side * (1 - z / away) - place) / (1 + side / away * slope_z)
            x = place + step
        slope_y = dr.gather(mi.Float, beam.slope_y, row)
        y, z = dr.gather(mi.Float, beam.y, row) + slope_y * step, z + slope_z * step
        # The part of the way from the point to the lamp at which the beam is.
        part = 1 - z / away
        across = (y - seen_from.y) / part
        # Edges of the strip: rays whose distance from the beam's tangent is the radius.
        tangent = mi.Vector3f(1, slope_y, slope_z)
        radius = _MARGIN * dr.gather(mi.Float, beam.radius, row)
        reach = radius / (part * dr.abs(side * slope_z + away))
        edges = []
        for sign in (-1, 1):
            edge = mi.Float(across)
            for _ in range(2):  # the first one is the middle's distance
                towards = mi.Vector3f(side, edge, -away)
                edge = across + sign * reach * dr.norm(dr.cross(towards, tangent))
            edges.append(dr.clip((seen_from.y + edge) / (2 * width) + 0.5, 0, 1))
        lower, upper = edges
        hides = (x >= first) & (x <= last) & (part > 0) & (part < 1) & (seen_from.z > nearest)
        return Overlap(dr.select(hides, lower, 0), dr.select(hides, upper - lower, 0))


@dataclass
class LampStrata(Strata):
    """Strata of a lamp seen from points `seen_from` (Dr.Jit), in the frame of the lamp."""

    seen_from: Any
    strip: HiddenStrip

    def overlap(self, along: Any) -> Overlap:
        """Compute the hidden part of a line across the lamp."""
        return self.strip.overlap(self.seen_from, along)
