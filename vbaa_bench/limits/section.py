"""Sections of a beam before a camera: where they are, and the side of one that the camera sees."""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.limits.imaged_beam import ImagedBeam
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.state import State, interpolated

# Points of an ellipse's outline: half a degree apart in phase.
_OUTLINE: Final = 720


@dataclass(frozen=True)
class Sections:
    """Sections of a beam before a camera, in the frame in which the camera is fixed.

    `s` (n,) [m] are their arc lengths, `points` (n, 3) [m] their middles, `tangents` (n, 3) the
    unit vectors across them, and `axes` (n, 2, 3) their own axes.
    """

    s: Floats
    points: Floats
    tangents: Floats
    axes: Floats


def sections(imaged: ImagedBeam, state: State, fractions: Floats) -> Sections:
    """Return the sections of a beam at increasing `fractions` (n,) of its length."""
    line, s = state.centreline, fractions * state.centreline[-1, 0]
    directions = np.gradient(line[:, 1:], line[:, 0], axis=0)
    first = state.director
    if first is None:  # a round section: any axis across the tangent
        first = np.cross([0.0, 0.0, 1.0], directions)
    points = state.points_at(s)
    tangents, first = (interpolated(s, line[:, 0], rows) for rows in (directions, first))
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    first -= np.einsum("ni,ni->n", first, tangents)[:, None] * tangents
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(tangents, first)], axis=1)
    turn, move = imaged.frame_from_clamp[:3, :3], imaged.frame_from_clamp[:3, 3]
    return Sections(s, points @ turn.T + move, tangents @ turn.T, axes @ turn.T)


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
    normals = interpolated(middles * half_width, place[order], outward)
    return VisibleSide(half_width, normals / np.linalg.norm(normals, axis=1, keepdims=True))
