"""Closed bodies of which objects and occluders are made, in metres, wound outward."""

from collections.abc import Sequence

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.mesh import Mesh, mesh_of
from vbaa_bench.geometry.tube import tube, tube_faces

# Largest distance [m] of a polygon's sides from its circle: well below the resolution of a camera
# or of a beam's contact, and yet few enough sides.
SAGITTA = 0.5e-6
MAX_SIDES = 2048


def side_count(radius: float, least: int = 128) -> int:
    """Compute the number of sides of the polygon for a circle of `radius` [m], a multiple of four.

    Its sides are within SAGITTA of the circle, radius (1 - cos(pi / n)), up to MAX_SIDES.
    """
    needed = np.pi * np.sqrt(radius / (2 * SAGITTA))
    return min(4 * int(np.ceil(max(needed, least) / 4)), MAX_SIDES)


def arc(radius: float, angle: Floats) -> Floats:
    """Compute points (n, 2) in x-y [m] of the circle that touches y = 0 at the origin from below.

    The angle (n,) [rad] at the circle's centre is measured from the origin anticlockwise.
    """
    return np.column_stack([-radius * np.sin(angle), radius * (np.cos(angle) - 1)])


def hexagon(apothem: float, count: int) -> Floats:
    """Compute the radii (count,) of a regular hexagon at equal steps of the angle about it."""
    angle = 2 * np.pi * np.arange(count) / count
    return np.asarray(apothem / np.cos((angle + np.pi / 6) % (np.pi / 3) - np.pi / 6))


def prism(outline: Floats, bottom: float, top: float) -> Mesh:
    """Mesh the upright prism over a convex, anticlockwise outline (n, 2) in x-y.

    It extends in z from bottom to top. Its vertices are the outline below, the outline above, and
    the middles of the two ends.
    """
    middle = outline.mean(axis=0, keepdims=True)
    flat = np.vstack([outline, outline, middle, middle])
    n = len(outline)
    z = np.concatenate([np.full(n, bottom), np.full(n, top), [bottom, top]])
    return mesh_of(np.column_stack([flat, z]), tube_faces(2, n))


def lofted(rings: Floats) -> Mesh:
    """Mesh the body through rings of vertices (rings, n, 3), each anticlockwise seen from the last.

    The first and the last ring are closed by a fan about their middles.
    """
    middles = rings[[0, -1]].mean(axis=1)
    vertices = np.vstack([*rings, middles])
    return mesh_of(vertices, tube_faces(*rings.shape[:2]))


def turned(radii: Floats, heights: Floats) -> Mesh:
    """Mesh a body about the z axis from `radii` (rings, sides) at `heights` (rings,), from below.

    A later ring that is lower and narrower makes a pocket.
    """
    angle = 2 * np.pi * np.arange(radii.shape[1]) / radii.shape[1]
    z = np.broadcast_to(heights[:, None], radii.shape)
    return lofted(np.stack([radii * np.cos(angle), radii * np.sin(angle), z], axis=-1))


def box(low: Floats, high: Floats) -> Mesh:
    """Mesh the upright box between two opposite corners, each (3,) [m]."""
    (left, back, bottom), (right, front, top) = low, high
    outline = np.array([[right, front], [left, front], [left, back], [right, back]])
    return prism(outline, bottom, top)


def rod(start: Floats, end: Floats, radius: float) -> Mesh:
    """Mesh a straight round rod between two different points, each (3,) [m]."""
    return tube(np.array([start, end]), radius, 64)


def together(bodies: Sequence[Mesh]) -> Mesh:
    """Join several bodies into one mesh; each stays closed in itself."""
    first = np.cumsum([0] + [len(body.vertices) for body in bodies[:-1]])
    faces = [body.faces + start for body, start in zip(bodies, first, strict=True)]
    vertices = np.vstack([body.vertices for body in bodies])
    return mesh_of(vertices, np.vstack(faces))


def slab(front: Floats, back: Floats) -> Mesh:
    """Mesh the body between two grids of points (n, m, 3) [m], closed along their rims.

    Seen from outside, the front's first index increases to the left and its second upwards.
    """
    rows, columns = front.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    face = _quads(a, d, c, b)
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    next_rim, offset = np.roll(rim, -1), rows * columns
    skirt = _quads(rim, rim + offset, next_rim + offset, next_rim)
    vertices = np.vstack([front.reshape(-1, 3), back.reshape(-1, 3)])
    faces = np.vstack([face, face[:, ::-1] + offset, skirt])
    return mesh_of(vertices, faces)


def _quads(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Split each quadrangle of the vertices a, b, c, d in turn into two triangles."""
    halves = [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
    return np.vstack([half.reshape(-1, 3) for half in halves])
