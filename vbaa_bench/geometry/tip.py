"""The shape of a round beam's tip: flat, round, cut obliquely or with a burr.

All lengths are [m]. Only the last piece of the mesh differs from that of a flat tip: one radius for
a round tip, two for a cut, and less than one for a burr. The beam's length stays the same.
"""

from collections.abc import Mapping
from typing import ClassVar, Final, Literal, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.mesh import Mesh

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


class TipShape:
    """A flat tip, and the base of the other shapes."""

    # Whether its end is not across the beam.
    oblique: ClassVar[bool] = False

    def rings(self, _radius: float) -> TipRings:
        """Place the rings of a tip of this radius [m]; a flat tip has none of its own."""
        return TipRings(np.empty(0), np.empty(0))

    def deform(self, rings: Floats, _turn: float, _random: np.random.Generator) -> Floats:
        """Move the vertices (n, facets, 3) of the beam's rings, in place.

        `turn` [rad] is a direction about the beam. Return how far (facets,) [m] the last ring
        recedes along the beam.
        """
        return np.zeros(rings.shape[1])


class _Round(TipShape):
    def rings(self, radius: float) -> TipRings:
        height = np.sin(_POLAR)
        return TipRings(radius * (height[-1] - height), np.cos(_POLAR))


class _Cut(TipShape):
    oblique = True

    def rings(self, radius: float) -> TipRings:
        return TipRings(radius * np.array([_CUT_LENGTH, 0.0]), np.ones(2))

    def deform(self, rings: Floats, turn: float, _random: np.random.Generator) -> Floats:
        facets, middle = rings.shape[1], rings[-1].mean(axis=0)
        tangent = middle - rings[-2].mean(axis=0)
        tangent /= np.linalg.norm(tangent)
        phase = 2 * np.pi * np.arange(facets) / facets - turn
        radius = np.linalg.norm(rings[-1] - middle, axis=1)
        depth = _SLOPE * (radius * np.cos(phase) + radius.max())
        rings[-1] -= depth[:, None] * tangent
        return np.asarray(depth)


class _Burr(TipShape):
    def rings(self, radius: float) -> TipRings:
        return TipRings(radius * np.array(_BURR_RINGS), np.ones(3))

    def deform(self, rings: Floats, turn: float, random: np.random.Generator) -> Floats:
        lip = _lip(rings.shape[1], turn, random)
        last = rings[-len(_BURR_SHARES) :]
        lips = np.array(_BURR_SHARES)[:, None, None] * lip[:, None]
        last += lips * (last - last.mean(axis=1, keepdims=True))
        return np.zeros(rings.shape[1])


TIPS: Final[Mapping[Tip, TipShape]] = {
    "flat": TipShape(),
    "round": _Round(),
    "cut": _Cut(),
    "burr": _Burr(),
}


def shaped(
    mesh: Mesh, arc_length: Floats, facets: int, tip: TipShape, random: np.random.Generator
) -> Floats:
    """Shape the end of a tube with its caps apart, in place.

    Return the arc lengths [m] of its vertices, which are `arc_length` (vertices,) before. The
    direction of a cut or a burr is drawn at random.
    """
    vertices, s = np.array(mesh.vertices), arc_length.copy()
    skin = len(vertices) - 2 * (facets + 1)
    rings, cap = vertices[:skin].reshape(-1, facets, 3), slice(skin + facets, skin + 2 * facets)
    depth = tip.deform(rings, random.uniform(0, 2 * np.pi), random)
    s[skin - facets : skin] -= depth
    s[-1] -= depth.mean()
    vertices[cap], vertices[-1] = rings[-1], rings[-1].mean(axis=0)
    s[cap] = s[skin - facets : skin]
    mesh.vertices = vertices
    return s


def _lip(facets: int, turn: float, random: np.random.Generator) -> Floats:
    """Draw the height (facets,) of a lip over the radius: on one side, and ragged."""
    phase = 2 * np.pi * np.arange(facets) / facets - turn
    ragged = sum(np.cos(n * phase + random.uniform(0, 2 * np.pi)) / n for n in (2, 3, 5))
    return np.asarray(_LIP * np.clip(0.5 + 0.5 * np.cos(phase) + 0.25 * ragged, 0, 1))
