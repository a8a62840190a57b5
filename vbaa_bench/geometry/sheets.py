"""Flat sheets, and the irradiance from luminous ones. All lengths are in [m]."""

import math

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.transforms import turn_about_z
from vbaa_bench.geometry.mesh import Mesh, mesh_of

# Segments of a ring; its inner and outer polygons keep the area of the true circles.
SEGMENTS = 48


def axes(ahead: Floats, along: Floats) -> Floats:
    """Compute the rows (3, 3) of a right-handed frame whose third axis is `ahead`.

    The first axis is as near to `along` as possible. Where `along` is parallel to `ahead`, +y
    replaces it.
    """
    ahead = ahead / np.linalg.norm(ahead)
    across = along - (along @ ahead) * ahead
    if np.linalg.norm(across) < 1e-6 * np.linalg.norm(along):
        across = np.array([0.0, 1.0, 0.0]) - ahead[1] * ahead
    across = across / np.linalg.norm(across)
    return np.array([across, np.cross(ahead, across), ahead])


def sheet(middle: Floats, side: float, facing: int) -> Mesh:
    """Mesh a square sheet across the z axis about `middle` (3,) [m], facing +z or -z (+1, -1)."""
    half = side / 2
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return mesh_of(corners + middle, faces[:, ::facing])


def edged_sheet(middle: Floats, side: float, azimuth: float, distance: float) -> Mesh:
    """Mesh a square sheet across z about `middle` (3,) that ends at a straight edge, facing +z.

    The edge is across the direction `azimuth` [rad], `distance` from the middle.
    """
    x = np.array([-side / 2, distance])
    corners = np.array([[x[0], -side / 2], [x[1], -side / 2], [x[1], side / 2], [x[0], side / 2]])
    points = np.column_stack([corners, np.zeros(4)])
    return mesh_of(middle + points @ turn_about_z(azimuth)[:3, :3].T, [[0, 1, 2], [0, 2, 3]])


def edge_side(
    middle: Floats, side: float, azimuth: float, distance: float, thickness: float
) -> Mesh:
    """Mesh the upright side of the edge of such a sheet, `thickness` high."""
    y = np.array([-side / 2, side / 2, side / 2, -side / 2])
    z = np.array([-thickness, -thickness, 0.0, 0.0])
    points = np.column_stack([np.full(4, distance), y, z])
    return mesh_of(middle + points @ turn_about_z(azimuth)[:3, :3].T, [[0, 1, 2], [0, 2, 3]])


def squares(side: float, square: float) -> tuple[Mesh, Mesh]:
    """Mesh the (light, dark) squares of a chequered sheet about the origin, facing +z.

    The sheet is no smaller than `side`; four squares meet at the origin.
    """
    count = 2 * max(math.ceil(side / (2 * square)), 1)
    row, column = np.mgrid[0:count, 0:count]
    edges = even_edges(count, square)
    return printed(edges, edges, (row + column) % 2 == 0)


def printed(x: Floats, y: Floats, dark: Mask) -> tuple[Mesh, Mesh]:
    """Mesh the (light, dark) cells of a printed sheet in z = 0, edge to edge, facing +z.

    The cells are between increasing edges in x and y; `dark` (rows, columns) counts rows from the
    top, the largest y.
    """
    right, up = np.meshgrid(x, y[::-1])
    corners = np.column_stack([right.ravel(), up.ravel(), np.zeros(right.size)])
    return _cells(corners, ~dark), _cells(corners, dark)


def even_edges(count: int, size: float) -> Floats:
    """Return the edges (count + 1,) of cells of one size, about 0."""
    return np.asarray((np.arange(count + 1) - count / 2) * size)


def _cells(corners: Floats, chosen: Mask) -> Mesh:
    """Mesh the chosen cells (rows, columns) between corners (n, 3), row by row from the top."""
    row, column = np.nonzero(chosen)
    stride = chosen.shape[1] + 1
    a = row * stride + column
    b, c, d = a + 1, a + stride + 1, a + stride
    return mesh_of(corners, np.vstack([np.column_stack([a, c, b]), np.column_stack([a, d, c])]))


def rectangle(
    middle: Floats, ahead: Floats, along: Floats, sides: Floats | tuple[float, float]
) -> Mesh:
    """Mesh a rectangle about `middle` (3,), facing `ahead` (3,), with one side along `along` (3,).

    That is the first of its `sides`.
    """
    first, second, _ = axes(ahead, along)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(sides) / 2
    corners = middle + half @ np.array([first, second])
    return mesh_of(corners, [[0, 1, 2], [0, 2, 3]])


def annulus(middle: Floats, ahead: Floats, inner: float, outer: float) -> Mesh:
    """Mesh a flat ring about `middle` (3,) that faces `ahead` (3,), between two radii."""
    first, second, _ = axes(ahead, np.array([1.0, 0.0, 0.0]))
    angle = 2 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    circle = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
    # Scale that gives a regular polygon the area of its circle.
    scale = np.sqrt(2 * np.pi / (SEGMENTS * np.sin(2 * np.pi / SEGMENTS)))
    vertices = middle + scale * np.vstack([inner * circle, outer * circle])
    a = np.arange(SEGMENTS)
    b = (a + 1) % SEGMENTS
    c, d = b + SEGMENTS, a + SEGMENTS
    # Both halves of a segment are neighbours: faces sampled in order go round the ring.
    faces = np.stack([np.stack([a, d, c], 1), np.stack([a, c, b], 1)], axis=1).reshape(-1, 3)
    return mesh_of(vertices, faces)


def irradiance(lamp: Mesh, at: Floats, normal: Floats) -> float:
    """Compute the irradiance from a lamp of radiance 1 at `at` (3,) with unit `normal` (3,).

    Lambert's formula is half the sum over a polygon's edges of the angle that each subtends times
    the cosine between the normal of the edge's plane and `normal`. The lamp must be above the
    surface's plane; faces turned away count as dark.
    """
    triangles = np.asarray(lamp.triangles) - at
    towards = -np.einsum("ij,ij->i", np.asarray(lamp.face_normals), triangles[:, 0])
    corners = triangles[towards > 0]
    next_corners = np.roll(corners, -1, axis=1)
    edges = np.cross(next_corners, corners)
    sines = np.linalg.norm(edges, axis=2)
    angles = np.arctan2(sines, np.einsum("ijk,ijk->ij", corners, next_corners))
    return float(0.5 * np.sum(angles * (edges @ normal) / sines))


def between(lamp: Mesh, starts: Floats, ends: Floats) -> Mask:
    """Test whether a lamp crosses the lines from `starts` (n, 3) to `ends` (n, 3).

    Each line is cut with every triangle (Moeller and Trumbore 1997).
    """
    first, second, third = np.moveaxis(np.asarray(lamp.triangles), 1, 0)
    edge_1, edge_2 = second - first, third - first
    ahead, away = (ends - starts)[:, None], starts[:, None] - first
    across = np.cross(ahead, edge_2)
    volume = (across * edge_1).sum(axis=-1)
    # A line parallel to the lamp's plane is not blocked.
    parallel = np.abs(volume) < 1e-12 * np.linalg.norm(ahead, axis=-1) * np.linalg.norm(
        np.cross(edge_1, edge_2), axis=-1
    )
    scale = 1 / np.where(parallel, 1.0, volume)
    u = (away * across).sum(axis=-1) * scale
    normal = np.cross(away, edge_1)
    v = (ahead * normal).sum(axis=-1) * scale
    fraction = (edge_2 * normal).sum(axis=-1) * scale
    hit = ~parallel & (u >= 0) & (v >= 0) & (u + v <= 1) & (fraction > 0) & (fraction < 1)
    return np.asarray(hit.any(axis=1))
