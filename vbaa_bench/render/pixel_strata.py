"""Samples of pixels that are stratified by a region between two edges, straight in each pixel."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from vbaa_bench.render.strata import Overlap, Strata, whole_share

# Range of the fraction of a partly covered pixel's samples that are inside the region. Chosen:
# neither side of an edge is left to a few samples.
_MIN_INSIDE, _MAX_INSIDE = 0.25, 0.75
# Places along a pixel at which the covered length across it is computed.
_KNOTS = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass
class PixelStrata(Strata):
    """Strata of pixels: edges relative to each pixel, lower and upper, left, then right."""

    edges: list[Any]

    def overlap(self, along: Any) -> Overlap:
        """Compute the covered part of the pixel at a place along it, from 0 to 1."""
        return _overlap(self.edges, along)


def pixel_strata(edges: list[Any], upright: Any, count: Any) -> PixelStrata:
    """Stratify `count` samples of pixels by edges relative to them, as in `PixelStrata`."""
    knots = [_overlap(edges, mi.Float(t)).length for t in _KNOTS]
    mean = sum(knots, mi.Float(0)) / len(knots)
    share = whole_share(dr.clip(mean, _MIN_INSIDE, _MAX_INSIDE), count)
    is_partly = (mean > 0) & (mean < 1) & (count > 1)
    return PixelStrata(share, is_partly, knots, upright, edges)


def _overlap(edges: list[Any], along: Any) -> Overlap:
    lower_left, upper_left, lower_right, upper_right = edges
    lower = dr.clip(dr.lerp(lower_left, lower_right, along), 0, 1)
    upper = dr.clip(dr.lerp(upper_left, upper_right, along), 0, 1)
    return Overlap(lower, dr.maximum(upper - lower, 0))
