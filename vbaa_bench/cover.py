"""What hides a stretch of the beam: the numbers, and the bodies between it and the camera."""

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.occluders import bars, leaves, sheet_over
from vbaa_bench.mechanics.state import State
from vbaa_bench.spec.objects import OcclusionSpec
from vbaa_bench.spec.trials import Cover

# Bars leave as much visible as they hide, where there is room for that.
SPARSEST = 2.0
# Leaves of half the stretch's length or less, but wide enough to be seen.
LARGEST_LEAF = 0.5


def hidden_stretch(cover: Cover | None, state: State) -> tuple[float, float] | None:
    """The stretch [m] of Sigma_a's x axis that is hidden (eq. 32); None where nothing is."""
    if cover is None or cover.availability >= 1:
        return None
    reach = float(state.tip[0])
    width = (1 - cover.availability) * reach
    middle = {"base": 0.0, "middle": reach / 2, "tip": reach}.get(cover.place, reach / 2)
    if cover.place == "contact" and state.contacts:
        middle = float(state.contact.point[0])
    start = float(np.clip(middle - width / 2, 0.0, reach - width))
    return start, start + width


def occluder(
    spec: OcclusionSpec,
    stretch: tuple[float, float],
    state: State,
    camera: Camera,
    random: np.random.Generator,
) -> trimesh.Trimesh:
    """The mesh [m] in Sigma_a that hides a stretch of the beam from the camera."""
    first, last = stretch
    if spec.body == "bars":
        reach = float(state.tip[0])
        hidden, middle = last - first, (first + last) / 2
        wide = min(SPARSEST * hidden, reach)
        first = float(np.clip(middle - wide / 2, 0.0, reach - wide))
        last = first + wide
    y = state.centreline[:, 2]
    margin = 0.1 * float(state.centreline[-1, 0])
    height = spec.height_mm * MILLIMETRE
    corners = np.array([[first, y.min() - margin, 0.0], [last, y.max() + margin, 0.0]])
    (x_from, y_from), (x_to, y_to) = _towards(camera, corners, height)
    if spec.body == "sheet":
        return sheet_over(x_from, x_to, y_from, y_to, height)
    if spec.body == "bars":
        share = hidden / (last - first)
        width = share * (x_to - x_from) / spec.count
        return bars(x_from, x_to, y_from, y_to, height, spec.count, 0.999 * width)
    size = min(3 * (x_to - x_from) / np.sqrt(spec.count), LARGEST_LEAF * (y_to - y_from))
    return leaves(x_from, x_to, y_from, y_to, height, spec.count, size, random)


def _towards(camera: Camera, points: Floats, height: float) -> Floats:
    """Where (n, 2) the lines of sight to points (n, 3) on plane C pass at `height` above it."""
    antenna_from_camera = invert(camera.camera_from_antenna)
    if camera.telecentric:
        sight = np.broadcast_to(-antenna_from_camera[:3, 2], points.shape)
    else:
        sight = antenna_from_camera[:3, 3] - points
    return np.asarray((points + sight * (height / sight[:, 2:]))[:, :2])
