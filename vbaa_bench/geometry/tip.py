"""The shape of a round beam's tip: flat, round, cut obliquely or with a burr.

All lengths are [m]. Only the last piece of the mesh differs from that of a flat tip: one radius for
a round tip, two for a cut, and less than one for a burr. The beam's length stays the same.
"""

from typing import Final, Literal, NamedTuple

import numpy as np
import trimesh

from solver.instrument.arrays import Floats

Tip = Literal["flat", "round", "cut", "burr"]

# Polar angles of the rings of a round tip, up to nearly its pole.
_POLAR: Final = np.deg2rad(np.linspace(0, 86, 9))
# Slope of a cut, 45 degrees, and its length over the radius, with a margin before it.
_SLOPE, _CUT_LENGTH = 1.0, 2.1
# A burr's rings before the end, over the radius, how much of its lip they have, and the lip's
# height over the radius. Chosen: as on a wire that was snapped off with pliers.
_BURR_RINGS, _BURR_SHARES, _LIP = (0.6, 0.25, 0.0), (0.0, 1.0, 0.7), 0.3


class TipRings(NamedTuple):
    """Rings of a tip: distance [m] from the beam's end, and radius over the beam's."""

    before_end: Floats
    factor: Floats


def tip_rings(shape: Tip, radius: float) -> TipRings:
    """Place the rings of a tip of `radius` [m]; a flat tip has none of its own."""
    match shape:
        case "flat":
            return TipRings(np.empty(0), np.empty(0))
        case "round":
            height = np.sin(_POLAR)
            return TipRings(radius * (height[-1] - height), np.cos(_POLAR))
        case "cut":
            return TipRings(radius * np.array([_CUT_LENGTH, 0.0]), np.ones(2))
        case "burr":
            return TipRings(radius * np.array(_BURR_RINGS), np.ones(3))


def shaped(
    mesh: trimesh.Trimesh,
    arc_length: Floats,
    facets: int,
    shape: Tip,
    random: np.random.Generator,
) -> Floats:
    """Cut the end of a tube with its caps apart, or give it a burr, in place.

    Return the arc lengths [m] of its vertices, which are `arc_length` (vertices,) before the cut.
    The direction of the cut and the lip are drawn at random.
    """
    vertices, s = np.array(mesh.vertices), arc_length.copy()
    skin = len(vertices) - 2 * (facets + 1)
    rings, cap = vertices[:skin].reshape(-1, facets, 3), slice(skin + facets, skin + 2 * facets)
    middle, turn = rings[-1].mean(axis=0), random.uniform(0, 2 * np.pi)
    if shape == "cut":
        tangent = middle - rings[-2].mean(axis=0)
        tangent /= np.linalg.norm(tangent)
        phase = 2 * np.pi * np.arange(facets) / facets - turn
        radius = np.linalg.norm(rings[-1] - middle, axis=1)
        depth = _SLOPE * (radius * np.cos(phase) + radius.max())
        rings[-1] -= depth[:, None] * tangent
        s[skin - facets : skin] -= depth
        s[-1] -= depth.mean()
    if shape == "burr":
        lip = _lip(facets, turn, random)
        last = rings[-len(_BURR_SHARES) :]
        lips = np.array(_BURR_SHARES)[:, None, None] * lip[:, None]
        last += lips * (last - last.mean(axis=1, keepdims=True))
    vertices[cap], vertices[-1] = rings[-1], rings[-1].mean(axis=0)
    s[cap] = s[skin - facets : skin]
    mesh.vertices = vertices
    return s


def _lip(facets: int, turn: float, random: np.random.Generator) -> Floats:
    """Draw the height (facets,) of a lip over the radius: on one side, and ragged."""
    phase = 2 * np.pi * np.arange(facets) / facets - turn
    ragged = sum(np.cos(n * phase + random.uniform(0, 2 * np.pi)) / n for n in (2, 3, 5))
    return np.asarray(_LIP * np.clip(0.5 + 0.5 * np.cos(phase) + 0.25 * ragged, 0, 1))
