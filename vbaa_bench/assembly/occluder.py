"""Occluders: meshes that hide a stretch of the beam from the camera."""

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.occluders import bars, leaves, sheet_over
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.occlusion import OcclusionSpec

# Ratio of the extent of all bars to the width that they hide: half is visible, if there is room.
BARS_EXTENT_RATIO = 2.0
# Maximum size of a leaf, relative to the hidden region's extent across the beam.
MAX_LEAF_RATIO = 0.5


def occluder(
    spec: OcclusionSpec,
    stretch: tuple[float, float],
    state: State,
    camera: Camera,
    camera_from_clamp: Floats,
    top: float,
    random: np.random.Generator,
) -> trimesh.Trimesh:
    """Build the mesh [m], in the clamp's frame, that hides a stretch of the beam from the camera.

    It is above the whole beam and above the `top` [m] of the object, across the lines of sight to
    that stretch.
    """
    line, (first, last) = state.centreline, stretch
    length, hidden = float(line[-1, 0]), last - first
    if spec.body == "bars":
        extent = min(BARS_EXTENT_RATIO * hidden, length)
        first = float(np.clip((first + last - extent) / 2, 0.0, length - extent))
        last = first + extent
    inside = (line[:, 1] >= first) & (line[:, 1] <= last)
    inside[np.abs(line[:, 1] - (first + last) / 2).argmin()] = True
    height = max(float(line[:, 3].max()), top) + spec.height_mm * MILLIMETRE
    projected = _project_to_height(camera, camera_from_clamp, line[inside, 1:], height)
    margin = 0.1 * length
    (x_from, y_from), (x_to, y_to) = projected.min(axis=0), projected.max(axis=0)
    # The stretch is an interval of x; its ends are between two rows of the centreline.
    x_from -= max(line[inside, 1].min() - first, 0.0)
    x_to += max(last - line[inside, 1].max(), 0.0)
    y_from, y_to = y_from - margin, y_to + margin
    if spec.body == "sheet":
        return sheet_over(x_from, x_to, y_from, y_to, height)
    if spec.body == "bars":
        width = hidden / (last - first) * (x_to - x_from) / spec.count
        return bars(x_from, x_to, y_from, y_to, height, spec.count, 0.999 * width)
    size = min(3 * (x_to - x_from) / np.sqrt(spec.count), MAX_LEAF_RATIO * (y_to - y_from))
    return leaves(x_from, x_to, y_from, y_to, height, spec.count, size, random)


def _project_to_height(
    camera: Camera, camera_from_clamp: Floats, points: Floats, height: float
) -> Floats:
    """Intersect (n, 2) [m] the lines of sight to points (n, 3) with a height above plane C."""
    clamp_from_camera = invert(camera_from_clamp)
    if camera.telecentric:
        direction = np.broadcast_to(-clamp_from_camera[:3, 2], points.shape)
    else:
        direction = apply(clamp_from_camera, np.zeros((1, 3))) - points
    return np.asarray((points + direction * ((height - points[:, 2:]) / direction[:, 2:]))[:, :2])
