"""Watertight mesh of the beam's surface, swept along its centreline."""

import numpy as np

from solver.instrument.arrays import Floats, copy_into
from solver.instrument.compiled import njit
from vbaa_bench.geometry.mesh import Mesh, mesh_of


def tube(
    centreline: Floats,
    radius: float | Floats,
    facets: int,
    director: Floats | None = None,
    aspect_ratio: float = 1.0,
    *,
    caps_apart: bool = False,
) -> Mesh:
    """Mesh a closed tube about `centreline` (n, 3) [m] with a radius [m] and `facets` round.

    The radius may taper, (n,). The section's first axis follows `director` (n, 3), unit vectors
    across the curve; its second semi-axis is `aspect_ratio` times the first, which is the radius.
    Without a director the rings follow a parallel-transported frame (no twist: Bishop 1975)
    that starts at +y, so that with a planar curve and an even number of facets one line of
    vertices is exactly on each side of the bend. The vertices are n rings of `facets`, then the
    two caps' middles; with `caps_apart`, the caps have rings of their own before them, because a
    vertex has one normal. Winding is outward.
    """
    angle = 2 * np.pi * np.arange(facets) / facets
    outline = np.column_stack([np.cos(angle), aspect_ratio * np.sin(angle)])
    return _swept(centreline, director, outline, radius, caps_apart)


def strip(
    centreline: Floats,
    director: Floats,
    thickness: float,
    width: float,
    *,
    caps_apart: bool = False,
) -> Mesh:
    """Mesh a closed strip about `centreline` (n, 3) [m] of rectangular section.

    Its thickness [m] is along `director` (n, 3), unit vectors across the curve, and its width
    [m] across both. Its vertices are those of a tube of four facets.
    """
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) / 2
    return _swept(centreline, director, corners * [thickness, width], 1.0, caps_apart)


def _swept(
    centreline: Floats,
    director: Floats | None,
    outline: Floats,
    scale: float | Floats,
    caps_apart: bool,
) -> Mesh:
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
    ends, n, facets = [0, -1], len(rings), len(outline)
    if caps_apart:
        faces = np.vstack([_sides(n, facets), _caps(n, n + 1, n + 2, facets)])
        vertices = np.vstack([*rings, *rings[ends], centreline[ends]])
    else:
        faces = tube_faces(n, facets)
        vertices = np.vstack([*rings, centreline[ends]])
    return mesh_of(vertices, faces)


def tube_faces(rings: int, facets: int) -> np.ndarray:
    """Return the triangles of a closed tube; they do not depend on its shape.

    Its vertices are `rings` rings of `facets`, then the middles of the two caps.
    """
    return np.vstack([_sides(rings, facets), _caps(0, rings - 1, rings, facets)])


def _sides(rings: int, facets: int) -> np.ndarray:
    ring = np.arange(rings - 1)[:, None] * facets
    corner = np.arange(facets)[None, :]
    after = (corner + 1) % facets
    a, b, c, d = ring + corner, ring + after, ring + facets + corner, ring + facets + after
    return np.stack([np.stack([a, b, c], -1), np.stack([b, d, c], -1)], axis=2).reshape(-1, 3)


def _caps(first: int, last: int, rings: int, facets: int) -> np.ndarray:
    """Return the triangles of both caps: numbers of their rings; `rings` precede the middles."""
    corner = np.arange(facets)
    after = (corner + 1) % facets
    start, end = np.full((2, facets), [[rings * facets], [rings * facets + 1]])
    first, last = first * facets, last * facets
    return np.vstack(
        [
            np.column_stack([start, first + after, first + corner]),
            np.column_stack([end, last + corner, last + after]),
        ]
    )


def arc_length_of_vertices(s: Floats, facets: int) -> Floats:
    """Return the arc length [m] of every vertex of a tube with its caps apart.

    `s` (n,) are those of its rings.
    """
    ends = s[[0, -1]]
    return np.concatenate([np.repeat(s, facets), np.repeat(ends, facets), ends])


def sides(vertices: Floats, facets: int) -> Floats:
    """Return the rings (n, facets, 3) of vertices of a tube with its caps apart, without these."""
    return vertices[: -2 * (facets + 1)].reshape(-1, facets, 3)


def around_of_vertices(rings: int, facets: int) -> Floats:
    """Return the place around the section of every vertex of a tube with its caps apart.

    It is 0 at the first facet, 1 half-way around, and 0 again: the far side mirrors the near one,
    so that a texture has no seam.
    """
    ring = 1 - np.abs(2 * np.arange(facets) / facets - 1)
    return np.concatenate([np.tile(ring, rings + 2), [0.5, 0.5]])


def normals(vertices: Floats, facets: int, *, oblique_tip: bool = False) -> Floats:
    """Compute outward unit normals of the vertices of a tube with its caps apart.

    They are those of the smooth surface through the vertices, and along the curve on the caps, but
    across the plane of an `oblique_tip`. Mitsuba would compute normals from the faces, by sums in
    changing order.
    """
    rings = sides(vertices, facets)
    around = np.roll(rings, -1, axis=1) - np.roll(rings, 1, axis=1)
    skin = np.cross(around, _tangents(rings))
    skin /= np.linalg.norm(skin, axis=-1, keepdims=True)
    start, end = _tangents(rings.mean(axis=1))[[0, -1]]
    if oblique_tip:
        spokes = rings[-1] - rings[-1].mean(axis=0)
        across = np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)
        end = across / np.linalg.norm(across)
    cap = np.repeat([-start, end], facets, axis=0)
    return np.vstack([*skin, cap, [-start, end]])


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
        copy_into(normals[i], normal)
    return normals


def _tangents(points: Floats) -> Floats:
    """Compute unit tangents of lines of points (n, ..., 3).

    They are those of the circle through three neighbours, and chords at the ends.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=-1, keepdims=True)
    chords = steps / lengths
    inner = (chords[:-1] * lengths[1:] + chords[1:] * lengths[:-1]) / (lengths[:-1] + lengths[1:])
    tangents = np.vstack([chords[:1], inner, chords[-1:]])
    return np.asarray(tangents / np.linalg.norm(tangents, axis=-1, keepdims=True))
