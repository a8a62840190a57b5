"""Touched surfaces of objects, as distance and direction from them.

All are in the object's frame: first contact is at the origin, +y points to the beam, +z along the
touched edge. A beam of radius r touches where the distance to its centreline is r.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.spatial import cKDTree

from solver.instrument.arrays import Floats

if TYPE_CHECKING:
    import trimesh  # not when it runs: scenes are read without it

# Faces that meet at less than this angle [rad] are one face: mesh files have about seven digits.
MIN_EDGE_ANGLE = 1e-4
# Edges whose distances differ by less than this fraction of the mesh's size are touched at once.
TIE = 1e-8

_ORIGIN, _Y, _Z = np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


class Surface(Protocol):
    """Touched surface in the object's frame."""

    def distance(self, point: Floats) -> tuple[float, Floats]:
        """Compute the distance [m] of a point (3,) [m] from the surface, and its direction.

        The direction (3,) is the unit vector from the surface. The distance is negative inside,
        and behind an edge or corner: a beam gets there only by passing through the object.
        """

    def touched_by(self, centreline: Floats) -> "Surface":
        """Return the smooth part touched by a beam along `centreline` (n, 3) [m], or all of it."""


@dataclass(frozen=True, eq=False)
class Line:
    """Edge, or cylinder of `radius` [m] about it.

    It runs through `point` along the unit vector `direction` and faces `outward`, each (3,).
    """

    point: Floats = field(default_factory=lambda: _ORIGIN)
    direction: Floats = field(default_factory=lambda: _Z)
    outward: Floats = field(default_factory=lambda: _Y)
    radius: float = 0.0

    def distance(self, point: Floats) -> tuple[float, Floats]:
        """Compute the distance [m] from the edge, or from the cylinder's side."""
        away = point - self.point
        away = away - (away @ self.direction) * self.direction
        return _signed_distance(away, self.outward, self.radius)

    def touched_by(self, centreline: Floats) -> Surface:  # noqa: ARG002 - it is all smooth
        """Return the whole surface."""
        return self


@dataclass(frozen=True, eq=False)
class Ball:
    """Corner at `point` that faces `outward`, each (3,), or ball of `radius` [m] about it."""

    point: Floats = field(default_factory=lambda: _ORIGIN)
    outward: Floats = field(default_factory=lambda: _Y)
    radius: float = 0.0

    def distance(self, point: Floats) -> tuple[float, Floats]:
        """Compute the distance [m] from the corner, or from the ball."""
        return _signed_distance(point - self.point, self.outward, self.radius)

    def touched_by(self, centreline: Floats) -> Surface:  # noqa: ARG002 - it is all smooth
        """Return the whole surface."""
        return self


@dataclass(frozen=True)
class Flat:
    """Wall perpendicular to y."""

    def distance(self, point: Floats) -> tuple[float, Floats]:
        """Return the height [m] above the wall."""
        return float(point[1]), _Y

    def touched_by(self, centreline: Floats) -> Surface:  # noqa: ARG002 - it is all smooth
        """Return the whole surface."""
        return self


def upright(radius: float = 0.0) -> Line:
    """Make an edge along z at the origin, or a cylinder of `radius` [m] with it on its side."""
    return Line(point=np.array([0.0, -radius, 0.0]), radius=radius)


def ball(radius: float) -> Ball:
    """Make a ball of `radius` [m] that touches the origin from below."""
    return Ball(point=np.array([0.0, -radius, 0.0]), radius=radius)


class Solid:
    """Closed mesh [m] that a straight beam touches at one of its edges, or at a corner."""

    def __init__(self, mesh: "trimesh.Trimesh") -> None:
        # A beam rests on convex edges, not on those of dents and of flat faces.
        convex = mesh.face_adjacency_convex & (mesh.face_adjacency_angles > MIN_EDGE_ANGLE)
        self._ends = np.asarray(mesh.vertices)[mesh.face_adjacency_edges[convex]]
        outward = mesh.face_normals[mesh.face_adjacency[convex]].sum(axis=1)
        self._outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
        self._faces = np.asarray(mesh.triangles)
        self._bounds = np.asarray(mesh.bounds)
        self._parts: dict[tuple[int, float], Surface] = {}

    def distance(self, point: Floats) -> tuple[float, Floats]:
        """Compute the distance [m] from the nearest edge."""
        return self.touched_by(point[None]).distance(point)

    def touched_by(self, centreline: Floats) -> Surface:
        """Find the edge or corner nearest to a beam that does not enter the mesh."""
        first, last = self._ends[:, 0], self._ends[:, 1]
        to_middle, _ = cKDTree(centreline).query((first + last) / 2)
        half = np.linalg.norm(last - first, axis=1) / 2
        pitch = float(np.linalg.norm(np.diff(centreline, axis=0), axis=1).max(initial=0.0))
        tie = TIE * float(np.ptp(self._ends))
        # Edges in the order of their least possible distance, up to that of the nearest one.
        bound = to_middle - half - pitch / 2
        distances, fractions = np.full((2, len(first)), np.inf)
        limit = np.inf
        for k in np.argsort(bound):
            if bound[k] > limit:
                break
            distances[k], fractions[k] = _closest_approach(first[k], last[k], centreline)
            limit = min(limit, float(distances[k]) + tie)
        # A beam that lies along a flat face leans on the edge nearer to the clamp, once it turns.
        tied = np.flatnonzero(distances <= distances.min() + tie)
        edge = int(tied[np.argmin(first[tied, 0] + last[tied, 0])])
        fraction = float(fractions[edge])
        key = (edge, fraction if fraction in (0.0, 1.0) else 0.5)
        if key not in self._parts:
            self._parts[key] = self._part(edge, fraction)
        return self._parts[key]

    def holds(self, points: Floats) -> bool:
        """Test whether any of the points (n, 3) [m] is inside.

        The faces' solid angles about it then sum to 4 pi (van Oosterom and Strackee 1983).
        """
        low, high = self._bounds
        for point in points[((points > low) & (points < high)).all(axis=1)]:
            a, b, c = np.moveaxis(self._faces - point, 1, 0)
            x, y, z = (np.sqrt((side**2).sum(axis=1)) for side in (a, b, c))
            volume = (a * np.cross(b, c)).sum(axis=1)
            area = x * y * z + (a * b).sum(axis=1) * z
            area = area + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
            if abs(2 * np.arctan2(volume, area).sum()) > 2 * np.pi:
                return True
        return False

    def _part(self, edge: int, fraction: float) -> Surface:
        first, last = self._ends[edge]
        if fraction in (0.0, 1.0):
            return Ball(point=self._ends[edge, int(fraction)], outward=self._outward[edge])
        direction = (last - first) / np.linalg.norm(last - first)
        return Line(point=first, direction=direction, outward=self._outward[edge])


def _signed_distance(away: Floats, outward: Floats, radius: float) -> tuple[float, Floats]:
    distance = float(np.sqrt(away @ away))
    side = -1.0 if radius == 0 and away @ outward < 0 else 1.0
    return side * distance - radius, side * away / distance


def _closest_approach(first: Floats, last: Floats, centreline: Floats) -> tuple[float, float]:
    """Find the least distance [m] between an edge and a polyline, and its place (0 to 1)."""
    along = last - first
    if len(centreline) == 1:
        fraction = float(np.clip((centreline[0] - first) @ along / (along @ along), 0, 1))
        return float(np.linalg.norm(first + fraction * along - centreline[0])), fraction
    start, step = centreline[:-1], np.diff(centreline, axis=0)
    # The least distance of two segments (Ericson 2005, section 5.1.9), for all steps at once.
    offset = first - start
    a, e = along @ along, np.einsum("ij,ij->i", step, step)
    b, c, f = step @ along, offset @ along, np.einsum("ij,ij->i", step, offset)
    parallel = a * e - b * b
    fraction = np.clip((b * f - c * e) / np.where(parallel > 0, parallel, np.inf), 0, 1)
    position = np.clip((b * fraction + f) / e, 0, 1)
    fraction = np.clip((b * position - c) / a, 0, 1)
    gaps = first + fraction[:, None] * along - start - position[:, None] * step
    distance = np.sqrt(np.einsum("ij,ij->i", gaps, gaps))
    nearest = int(np.argmin(distance))
    return float(distance[nearest]), float(fraction[nearest])
