"""Fisher information of the images of the calibration board on the camera.

It is that of all edges of the printed pattern: each informs on its position across it. In view 0
the board lies in plane C, up to the rig's tolerances; in the other views its pose is unknown.
"""

from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply
from vbaa_bench.assembly.scene_assembler import BLACK, WHITE, SceneAssembler
from vbaa_bench.geometry.board import Cells, cells
from vbaa_bench.limits.camera_parameters import (
    POSE,
    camera_parameters,
    camera_unit,
    changed_camera,
    small_motion,
)
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.profile import PixelNoise, edge_information
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.reflection import Reflection
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.rigs import nominal_rig
from vbaa_bench.sensor.from_spec import image_sensor, unsaturated_exposure

# Errors of the board's pose in view 0: turn [rad] about its middle, move [m] in Sigma_a.
_PREFIX: Final = "board_"
BOARD: Final = tuple(_PREFIX + name for name in POSE)
# Relative step of the central differences.
_STEP: Final = 1e-4
# Directions for which the information of an edge is computed; others are interpolated. Chosen.
_DIRECTIONS: Final = 13


class _Edges(NamedTuple):
    """Straight pieces of edges between black and white: from `start` to `end` (n, 3) [m]."""

    start: Floats
    end: Floats


def board_information(assembler: SceneAssembler, exposure: float) -> Information:
    """Compute the information of all views on the camera's parameters and on BOARD.

    The light on the board is that of view 0.
    """
    edges = _edges(cells(nominal_rig(assembler.scene).board))
    of_directions = _per_pixel(assembler, exposure)
    total = Information((), np.zeros((0, 0)))
    for view in range(assembler.scene.calibration.views):
        pose = assembler.antenna_from_board(view)
        of_view = _view(assembler.rig.camera, edges, pose, of_directions)
        total += of_view if view == 0 else of_view.eliminated(BOARD)
    return total


def _edges(printed: Cells) -> _Edges:
    """Find the edges between neighbouring black and white cells."""
    # Rows of cells are counted from the top.
    y = printed.y[::-1]
    row, column = np.nonzero(printed.black[:, 1:] != printed.black[:, :-1])
    upright = printed.x[column + 1], y[row], printed.x[column + 1], y[row + 1]
    row, column = np.nonzero(printed.black[1:] != printed.black[:-1])
    level = printed.x[column], y[row + 1], printed.x[column + 1], y[row + 1]
    x_0, y_0, x_1, y_1 = np.concatenate([upright, level], axis=1)
    zero = np.zeros_like(x_0)
    return _Edges(np.column_stack([x_0, y_0, zero]), np.column_stack([x_1, y_1, zero]))


def _view(camera: Camera, edges: _Edges, pose: Floats, of_directions: Floats) -> Information:
    """Compute the information of one view on the camera's parameters and on BOARD."""
    start, end, middle = (
        camera.project(apply(pose, points))
        for points in (edges.start, edges.end, (edges.start + edges.end) / 2)
    )
    along = end - start
    lengths = np.linalg.norm(along, axis=1)
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / lengths[:, None]
    inside = camera.contains(middle)

    def project(name: str, change: float) -> Floats:
        points = (edges.start + edges.end) / 2
        if name not in BOARD:
            return changed_camera(camera, name, change).project(apply(pose, points))
        # The board turns about its own middle.
        motion, moved = small_motion(name.removeprefix(_PREFIX), change), pose.copy()
        moved[:3, :3] = motion[:3, :3] @ pose[:3, :3]
        moved[:3, 3] += motion[:3, 3]
        return camera.project(apply(moved, points))

    names, changes = (*camera_parameters(camera), *BOARD), []
    for name in names:
        step = _STEP * (1.0 if name in BOARD else camera_unit(camera, name))
        difference = (project(name, step) - project(name, -step)) / (2 * step)
        changes.append((difference * normals).sum(axis=1)[inside])
    angle = np.arctan2(normals[:, 1], normals[:, 0]) % np.pi
    of_edges = np.interp(angle, np.linspace(0, np.pi, _DIRECTIONS), of_directions)
    gradients = np.array(changes)
    return Information(names, gradients * (of_edges * lengths)[inside] @ gradients.T)


def _per_pixel(assembler: SceneAssembler, exposure: float) -> Floats:
    """Compute the information [1/px^2] of a pixel's length of an edge, for _DIRECTIONS."""
    scene, camera = assembler.scene, assembler.rig.camera
    lamps = lights(scene, assembler.folder, panels=False)
    reflection = Reflection(lamps, assembler.unit.render_from_antenna)
    pose = assembler.antenna_from_board(0)
    point, normal = pose[None, :3, 3], pose[None, :3, 2]
    towards = camera.directions_from(point)
    black, white = (
        float(reflection.radiance(PaintedPart(reflectance=value), point, normal, towards)[0])
        for value in (BLACK, WHITE)
    )
    sensor = image_sensor(scene.sensor, unsaturated_exposure(scene.sensor, exposure, white))
    light, blur = np.array([white]), scene.optics.point_spread_px
    variance = PixelNoise.of(scene.sensor, sensor).variance

    angles = np.linspace(0, np.pi, _DIRECTIONS)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate(
        [edge_information(black, light, normal, blur, variance) for normal in directions]
    )
