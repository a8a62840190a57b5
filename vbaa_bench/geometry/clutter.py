"""Simple things that lie on the ground. Lengths are [m]."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, turn_about_z
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import box, hexagon, turned
from vbaa_bench.geometry.tube import tube

# Kinds of things; each has its shape in `_SHAPES`.
Thing = Literal["box", "disc", "nut", "rod", "screwdriver", "cable"]

_SIDES = 48
_CABLE_POINTS, _CABLE_SIDES = 80, 16
# Draws of a place for one thing. Chosen: a place that takes more is too crowded.
_TRIES = 100
# Bodies are apart by this fraction of their radii, which circumscribe them. Chosen: long things
# may cross each other's circles.
_APART = 0.7


@dataclass(frozen=True)
class Sector:
    """Sector of a ring about `axis` (2,): radii [m] and angles [rad], from low to high."""

    axis: Floats
    radii: tuple[float, float]
    angles: tuple[float, float]

    def distance(self, place: Floats) -> float:
        """Compute the distance [m] of a place (2,) from the sector, 0 within it."""
        offset, (inner, outer), (low, high) = place - self.axis, self.radii, self.angles
        radius = float(np.linalg.norm(offset))
        angle = float(np.arctan2(offset[1], offset[0]))
        if high - low >= 2 * np.pi or (angle - low) % (2 * np.pi) <= high - low:
            return max(radius - outer, inner - radius, 0.0)
        rims = []
        for rim in (low, high):
            along = np.array([np.cos(rim), np.sin(rim)])
            nearest = np.clip(offset @ along, inner, outer) * along
            rims.append(float(np.linalg.norm(offset - nearest)))
        return min(rims)


@dataclass(frozen=True)
class Room:
    """The part of the ground on which things may lie.

    It is the rectangle from `low` to `high`, each (2,) [m], less a `margin` [m] about the `taken`
    sectors, and less the half-plane beyond an edge: `edge` holds its unit normal and its distance
    from the origin, (3,).
    """

    low: Floats
    high: Floats
    taken: tuple[Sector, ...]
    margin: float
    edge: Floats | None = None

    def holds(self, place: Floats, radius: float) -> bool:
        """Test whether a circle about a place (2,) is free."""
        if self.edge is not None and place @ self.edge[:2] + radius > self.edge[2]:
            return False
        return all(part.distance(place) > radius + self.margin for part in self.taken)


def places(room: Room, radii: Floats, random: np.random.Generator) -> Floats:
    """Draw places (n, 2) [m] of things with circumscribed `radii` (n,); NaN if there is no room."""
    drawn = np.full((len(radii), 2), np.nan)
    for number, radius in enumerate(radii):
        for place in random.uniform(room.low - radius, room.high + radius, (_TRIES, 2)):
            apart = np.linalg.norm(drawn[:number] - place, axis=1)
            overlaps = apart < _APART * (radii[:number] + radius)
            if room.holds(place, radius) and not overlaps.any():
                drawn[number] = place
                break
    return drawn


def thing(kind: Thing, size: float, height: float, random: np.random.Generator) -> Mesh:
    """Mesh a thing whose largest side is about `size`, lying on z = 0 about the origin.

    It has a random heading and proportions, and is shrunk if it is higher than `height`.
    """
    mesh = _SHAPES[kind](size, random)
    vertices = np.asarray(mesh.vertices)
    vertices = vertices * min(1.0, height / float(vertices[:, 2].max()))
    mesh.vertices = apply(turn_about_z(random.uniform(0, 2 * np.pi)), vertices)
    return mesh


def _box(size: float, random: np.random.Generator) -> Mesh:
    half = size / 2 * np.array([1.0, random.uniform(0.3, 1.0), 0.0])
    top = np.array([0.0, 0.0, size * random.uniform(0.1, 0.4)])
    return box(-half, half + top)


def _disc(size: float, random: np.random.Generator) -> Mesh:
    """Mesh a disc with a knob, as of a weight."""
    height, knob = size * random.uniform(0.1, 0.3), random.uniform(0.15, 0.6)
    bevel = 0.05 * size
    radii = np.array([0.5, 0.5, 0.45, 0.5 * knob, 0.5 * knob]) * size
    heights = np.array([0.0, height - bevel / 2, height, height, height + 0.3 * knob * size])
    return turned(radii[:, None] * np.ones(_SIDES), heights)


def _nut(size: float, random: np.random.Generator) -> Mesh:
    """Mesh a hexagonal nut; the bottom of its hole is closed."""
    apothem, height = size / 2 * np.cos(np.pi / 6), size * random.uniform(0.3, 0.45)
    outer, hole = hexagon(apothem, _SIDES), np.full(_SIDES, 0.26 * size)
    radii = np.array([outer, outer, np.minimum(outer, 0.96 * apothem), hole, hole])
    heights = np.array([0.0, 0.93, 1.0, 1.0, 0.05]) * height
    return turned(radii, heights)


def _rod(size: float, random: np.random.Generator) -> Mesh:
    """Mesh a pencil."""
    radius = size * random.uniform(0.025, 0.06)
    return _lying(np.array([1.0, 1.0, 0.15]) * radius, np.array([0.0, 0.88, 1.0]) * size)


def _screwdriver(size: float, random: np.random.Generator) -> Mesh:
    grip = size * random.uniform(0.06, 0.1)
    share = np.array([0.7, 1.0, 1.0, 0.8, 1.0, 0.6, 0.28, 0.28, 0.36, 0.36])
    along = np.array([0.0, 0.03, 0.25, 0.3, 0.35, 0.4, 0.41, 0.93, 0.95, 1.0])
    return _lying(grip * share, along * size)


def _lying(radii: Floats, along: Floats) -> Mesh:
    """Mesh a turned body on its side, along x about the origin, lying on z = 0."""
    body = turned(radii[:, None] * np.ones(_SIDES), along - along.mean())
    # The axes z, x, y of the turned body become x, y, z.
    body.vertices = np.asarray(body.vertices)[:, [2, 0, 1]] + [0.0, 0.0, radii.max()]
    return body


def _cable(size: float, random: np.random.Generator) -> Mesh:
    """Mesh a cable in loose bends."""
    t = np.linspace(0, 2 * np.pi, _CABLE_POINTS)
    heading = sum(
        random.uniform(-2.2, 2.2) / n * np.sin(n * t / 2 + random.uniform(0, 2 * np.pi))
        for n in (1, 2, 3)
    )
    steps = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(len(t))])
    line = np.cumsum(steps, axis=0)
    line -= (line.max(axis=0) + line.min(axis=0)) / 2
    line *= size / (2 * np.linalg.norm(line, axis=1).max())
    radius = size * random.uniform(0.012, 0.03)
    return tube(line + np.array([0.0, 0.0, radius]), radius, _CABLE_SIDES)


_SHAPES: Final[Mapping[Thing, Callable[[float, np.random.Generator], Mesh]]] = {
    "box": _box,
    "disc": _disc,
    "nut": _nut,
    "rod": _rod,
    "screwdriver": _screwdriver,
    "cable": _cable,
}
