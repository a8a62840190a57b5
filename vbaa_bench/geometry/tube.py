"""Watertight mesh of the beam's surface, swept along its centreline."""

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit


def tube(
    centreline: Floats,
    radius: float | Floats,
    facets: int,
    director: Floats | None = None,
    aspect_ratio: float = 1.0,
) -> trimesh.Trimesh:
    """Mesh a closed tube about `centreline` (n, 3) [m] with a radius [m] and `facets` round.

    The radius may taper, (n,). The section's first axis follows `director` (n, 3), unit vectors
    across the curve; its second semi-axis is `aspect_ratio` times the first, which is the radius.
    Without a director the rings follow a parallel-transported frame (no twist: Bishop 1975)
    that starts at +y, so that with a planar curve and an even number of facets one line of
    vertices is exactly on each side of the bend. The vertices are n rings of `facets`, then the
    two caps' middles. Winding is outward.
    """
    angle = 2 * np.pi * np.arange(facets) / facets
    outline = np.column_stack([np.cos(angle), aspect_ratio * np.sin(angle)])
    return _swept(centreline, director, outline, radius)


def strip(centreline: Floats, director: Floats, thickness: float, width: float) -> trimesh.Trimesh:
    """Mesh a closed strip about `centreline` (n, 3) [m] of rectangular section.

    Its thickness [m] is along `director` (n, 3), unit vectors across the curve, and its width
    [m] across both. Its vertices are those of a tube of four facets.
    """
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) / 2
    return _swept(centreline, director, corners * [thickness, width], 1.0)


def _swept(
    centreline: Floats, director: Floats | None, outline: Floats, scale: float | Floats
) -> trimesh.Trimesh:
    """Mesh the surface of a section (facets, 2) swept along the curve and scaled, () or (n,)."""
    tangents = _tangents(centreline)
    if director is None:
        normals = _transported(tangents)
    else:
        # A director across the true curve is not exactly across that of the given points.
        normals = director - (director * tangents).sum(axis=1, keepdims=True) * tangents
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    binormals = np.cross(tangents, normals)
    around = outline[:, :1] * normals[:, None, :] + outline[:, 1:] * binormals[:, None, :]
    sizes = np.broadcast_to(scale, len(centreline))
    rings = centreline[:, None, :] + sizes[:, None, None] * around
    vertices = np.vstack([rings.reshape(-1, 3), centreline[0], centreline[-1]])
    return trimesh.Trimesh(vertices, tube_faces(len(centreline), len(outline)), process=False)


def tube_faces(rings: int, facets: int) -> np.ndarray:
    """Return the triangles of a tube of `rings` rings; they do not depend on its shape."""
    ring = np.arange(rings - 1)[:, None] * facets
    corner = np.arange(facets)[None, :]
    after = (corner + 1) % facets
    a, b, c, d = ring + corner, ring + after, ring + facets + corner, ring + facets + after
    side = np.stack([np.stack([a, b, c], -1), np.stack([b, d, c], -1)], axis=2).reshape(-1, 3)
    ring_start, ring_next = corner[0], after[0]
    start, end = rings * facets, rings * facets + 1
    first = np.column_stack([np.full(facets, start), ring_next, ring_start])
    last_ring = (rings - 1) * facets
    last = np.column_stack([np.full(facets, end), last_ring + ring_start, last_ring + ring_next])
    return np.vstack([side, first, last])


def arc_length_of_vertices(s: Floats, facets: int) -> Floats:
    """Return the arc length [m] of every vertex of `tube`, from that of its rings, `s` (n,)."""
    return np.concatenate([np.repeat(s, facets), [s[0], s[-1]]])


def _transported(tangents: Floats) -> Floats:
    """Compute unit normals (n, 3) that start nearest +y and do not twist about tangents (n, 3).

    On a curve that starts along y itself they start nearest +z.
    """
    along_y = abs(tangents[0, 1]) > 0.99
    first = np.array([0.0, 0.0, 1.0]) if along_y else np.array([0.0, 1.0, 0.0])
    return np.asarray(_transport(first, np.ascontiguousarray(tangents)))


@njit
def _transport(normal: Floats, tangents: Floats) -> Floats:
    """Carry a normal (3,) along tangents (n, 3); return normals (n, 3)."""
    normals = np.empty_like(tangents)
    for i in range(len(tangents)):
        normal = normal - (normal * tangents[i]).sum() * tangents[i]
        normal = normal / np.sqrt((normal**2).sum())
        normals[i] = normal
    return normals


def _tangents(points: Floats) -> Floats:
    """Compute unit tangents (n, 3): of the circle through three neighbours, chords at the ends."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    chords = steps / lengths
    inner = (chords[:-1] * lengths[1:] + chords[1:] * lengths[:-1]) / (lengths[:-1] + lengths[1:])
    tangents = np.vstack([chords[:1], inner, chords[-1:]])
    return np.asarray(tangents / np.linalg.norm(tangents, axis=1, keepdims=True))
