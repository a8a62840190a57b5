"""Occlusion of a frame: the stretch of the beam to hide, and the body that hides it."""

from typing import Final

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.frames import Cover
from vbaa_bench.scene.occlusion import Area, OcclusionSpec

# A stretch about the contact has it at a random place in its middle 80 %: a fixed place would
# reveal the contact.
_MAX_OFFSET: Final = 0.4


def hidden_stretch(
    cover: Cover | None, state: State, length: float, random: np.random.Generator
) -> tuple[float, float] | None:
    """Choose the stretch [m] of Sigma_a's x axis to hide (eq. 32); None if nothing is hidden.

    It is relative to the nominal `length` [m] of the beam, so that it reveals nothing about the
    deflection.
    """
    if cover is None or cover.availability >= 1:
        return None
    width = (1 - cover.availability) * length
    middle = {"base": 0.0, "middle": length / 2, "tip": length}.get(cover.place, length / 2)
    if cover.place == "contact" and state.contacts:
        middle = float(state.contact.point[0]) + random.uniform(-1, 1) * _MAX_OFFSET * width
    start = float(np.clip(middle - width / 2, 0.0, length - width))
    return start, start + width


def occluder_mesh(
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
    line, occluder = state.centreline, spec.occluder
    assert occluder is not None
    length, hidden = float(line[-1, 0]), stretch[1] - stretch[0]
    first, last = occluder.spread(*stretch, length)
    inside = (line[:, 1] >= first) & (line[:, 1] <= last)
    inside[np.abs(line[:, 1] - (first + last) / 2).argmin()] = True
    height = max(float(line[:, 3].max()), top) + spec.height_mm * MILLIMETRE
    projected = _project_to_height(camera, camera_from_clamp, line[inside, 1:], height)
    margin = 0.1 * length
    (x_from, y_from), (x_to, y_to) = projected.min(axis=0), projected.max(axis=0)
    # The stretch is an interval of x; its ends are between two rows of the centreline.
    x_from -= max(line[inside, 1].min() - first, 0.0)
    x_to += max(last - line[inside, 1].max(), 0.0)
    area = Area(x_from, x_to, y_from - margin, y_to + margin, height)
    return occluder.mesh(area, hidden / (last - first), spec.count, random)


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
