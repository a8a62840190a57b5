"""Extent, edge and smallest square of the ground, from the camera's view."""

import math

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, invert, turn_about_z
from solver.instrument.units import MILLIMETRE
from vbaa_bench.scene.schema import Scene

# Margin beyond the camera's view, for the lens's blur.
_MARGIN = 1.05
# Largest extent to either side of the beam's middle, over its length: a camera that looks across
# the ground sees it to the horizon.
_MAX_EXTENT = 3.0
# Both tones of a chequered pattern are distinct if a square has at least two pixels.
RESOLVED_PX = 2.0
# Most squares along a side: each takes about 1 kB in the renderer, so that all take 1 GB at most.
MAX_SQUARES = 1000


def chequered_side(scene: Scene, camera: Camera) -> float:
    """Compute the side [m] of a square sheet about the beam's middle that fills the image.

    It fills the image at every motor angle.
    """
    length = scene.beam.length_mm * MILLIMETRE
    middle = np.array([length / 2, 0.0])
    axis = -np.array(scene.clamp_offset_mm[:2]) * MILLIMETRE
    footprint = _footprint(camera, -scene.background.distance_mm * MILLIMETRE)
    half = math.inf
    if footprint is not None and scene.background.fixed_to == scene.camera.mount:
        half = float(np.abs(footprint - middle).max())
    elif footprint is not None:
        radius = np.linalg.norm(footprint - axis, axis=1).max()
        half = float(radius + np.linalg.norm(middle - axis))
    return 2 * min(_MARGIN * half, _MAX_EXTENT * length)


def view_of_ground(scene: Scene, camera: Camera) -> tuple[Floats, Floats]:
    """Compute the corners (2,), (2,) [m] of a rectangle of the ground that contains the view.

    It is a square about the motor's axis if the ground turns against the camera, and limited where
    the camera sees the horizon.
    """
    length = scene.beam.length_mm * MILLIMETRE
    middle = np.array([length / 2, 0.0])
    footprint = _footprint(camera, -scene.background.distance_mm * MILLIMETRE)
    if footprint is None:
        return middle - _MAX_EXTENT * length, middle + _MAX_EXTENT * length
    if scene.background.fixed_to != scene.camera.mount:
        axis = -np.array(scene.clamp_offset_mm[:2]) * MILLIMETRE
        radius = float(np.linalg.norm(footprint - axis, axis=1).max())
        return axis - radius, axis + radius
    return footprint.min(axis=0), footprint.max(axis=0)


def edged_sheet(middle: Floats, side: float, azimuth: float, distance: float) -> trimesh.Trimesh:
    """Mesh a square sheet across z about `middle` (3,) that ends at a straight edge, facing +z.

    The edge is across the direction `azimuth` [rad], `distance` from the middle.
    """
    x = np.array([-side / 2, distance])
    corners = np.array([[x[0], -side / 2], [x[1], -side / 2], [x[1], side / 2], [x[0], side / 2]])
    points = np.column_stack([corners, np.zeros(4)])
    vertices = middle + points @ turn_about_z(azimuth)[:3, :3].T
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], process=False)


def edge_side(
    middle: Floats, side: float, azimuth: float, distance: float, thickness: float
) -> trimesh.Trimesh:
    """Mesh the upright side of the edge of such a sheet, `thickness` high."""
    y = np.array([-side / 2, side / 2, side / 2, -side / 2])
    z = np.array([-thickness, -thickness, 0.0, 0.0])
    points = np.column_stack([np.full(4, distance), y, z])
    vertices = middle + points @ turn_about_z(azimuth)[:3, :3].T
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], process=False)


def finest_square(scene: Scene, camera: Camera) -> float:
    """Compute the smallest square [m] of a chequered ground.

    The camera must resolve it, and the renderer must be able to hold all squares.
    """
    length = scene.beam.length_mm * MILLIMETRE
    ground_point = np.array([[length / 2, 0.0, -scene.background.distance_mm * MILLIMETRE]])
    resolved = RESOLVED_PX / float(camera.pixels_per_metre(ground_point)[0])
    return max(resolved, chequered_side(scene, camera) / MAX_SQUARES)


def _footprint(camera: Camera, height: float) -> Floats | None:
    """Project the image's rim to points (n, 2) [m] of the plane z = `height`.

    Returns None where a part of the rim does not show the plane.
    """
    across, down = (
        np.linspace(-0.5, camera.width - 0.5, 17),
        np.linspace(-0.5, camera.height - 0.5, 17),
    )
    rim = [(u, v) for u in across for v in down[[0, -1]]]
    rim += [(u, v) for u in across[[0, -1]] for v in down]
    x, y = camera.normalised(np.array(rim)).T
    zeros, ones = np.zeros_like(x), np.ones_like(x)
    antenna_from_camera = invert(camera.camera_from_antenna)
    start = np.column_stack([x, y, zeros] if camera.telecentric else [zeros] * 3)
    direction = np.column_stack([zeros, zeros, ones] if camera.telecentric else [x, y, ones])
    start, direction = apply(antenna_from_camera, start), direction @ antenna_from_camera[:3, :3].T
    if (direction[:, 2] >= 0).any():
        return None
    fraction = (height - start[:, 2]) / direction[:, 2]
    return np.asarray((start + fraction[:, None] * direction)[:, :2])
