"""The side of a beam's section that a camera sees: its width, and its normals across it."""

from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.mechanics.rod import Rod

# Points of an ellipse's outline: half a degree apart in phase.
_OUTLINE = 720


class VisibleSide(NamedTuple):
    """Half of the visible width [m], and outward normals (k, 3) at k even offsets across it."""

    half_width: float
    normals: Floats


def visible_side(
    rod: Rod, s: float, axes: Floats, across: Floats, towards: Floats, offsets: int
) -> VisibleSide:
    """Find the visible side of the section at arc length `s` [m].

    `axes` (2, 3) are the section's two axes; `across` (3,), in the image, and `towards` (3,), to
    the camera, are unit vectors across the tangent and across each other. Offsets are the middles
    of equal parts of the width, in the direction of `across`.
    """
    first = rod.half_height(s)
    half = np.array([first, first * rod.aspect_ratio])
    projected = half * (axes @ across)
    middles = (np.arange(offsets) + 0.5) / offsets * 2 - 1
    if rod.shape == "rectangle":
        # The face across an axis has its middle where that axis ends.
        sign = np.sign(axes @ towards)
        place = middles[:, None] * np.abs(projected).sum()
        beyond = np.abs(place - sign * projected) - np.abs(projected[::-1])
        normals = (sign[:, None] * axes)[np.argmin(beyond, axis=1)]
        return VisibleSide(float(np.abs(projected).sum()), normals)
    phase = 2 * np.pi * np.arange(_OUTLINE) / _OUTLINE
    wave = np.column_stack([np.cos(phase), np.sin(phase)])
    visible = (wave / half) @ (axes @ towards) > 0
    place = wave[visible] @ projected
    order = np.argsort(place)
    outward = ((wave / half) @ axes)[visible][order]
    half_width = float(np.hypot(*projected))
    normals = np.column_stack([np.interp(middles * half_width, place[order], n) for n in outward.T])
    return VisibleSide(half_width, normals / np.linalg.norm(normals, axis=1, keepdims=True))
