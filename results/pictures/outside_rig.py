"""Bodies of the rig that its own camera does not see: camera, stand, motor, lamps, table."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import trimesh

from results.pictures.outside_render import Colour, ColouredBody, Viewpoint
from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.geometry import sheets
from vbaa_bench.geometry.solids import box, rod, together, turned
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.lights.emitter import Emitter

# Colours by the names of surfaces; all are chosen by eye.
_COLOURS: Final[dict[str, Colour]] = {
    "beam": (0.70, 0.04, 0.02),
    "object": (0.05, 0.22, 0.55),
    "second_peg": (0.05, 0.22, 0.55),
    "occluder": (0.10, 0.35, 0.12),
    "hub": (0.25, 0.25, 0.27),
    "adaptor": (0.25, 0.25, 0.27),
    "jaw": (0.50, 0.52, 0.55),
    "flange": (0.20, 0.21, 0.24),
    "cable": (0.03, 0.03, 0.03),
    "background": (0.52, 0.36, 0.22),
    "background_squares": (0.22, 0.13, 0.07),
}
_THINGS: Final = np.array(
    [(0.6, 0.1, 0.08), (0.1, 0.4, 0.2), (0.75, 0.55, 0.1), (0.15, 0.15, 0.17), (0.65, 0.65, 0.6)]
)
_DARK: Colour = (0.03, 0.03, 0.035)
_STEEL: Colour = (0.35, 0.36, 0.38)
_HOUSING: Colour = (0.78, 0.78, 0.76)
_SIDES = 96
# Sizes over the beam's length: the table in x and y and its thickness, the stand's radius and its
# distance from the camera, camera body and lens, the motor's radius.
_TABLE, _THICKNESS = (2.6, 2.2), 0.08
_POLE, _POLE_AWAY = 0.025, 0.75
_CAMERA_SIDE, _CAMERA_DEPTH, _LENS_RADIUS, _LENS_LENGTH = 0.17, 0.22, 0.065, 0.16
_MOTOR = 0.075
# Rim of a lamp's housing, its depth, and how far it is behind the panel, over the beam's length.
_RIM, _DEPTH, _BEHIND = 0.05, 0.10, 0.02


def rig_bodies(
    assembler: SceneAssembler, surfaces: dict[str, Surface], lights: Sequence[Emitter]
) -> dict[str, ColouredBody]:
    """Colour the surfaces of a frame, and add the bodies around them, in Sigma_a [m]."""
    length = assembler.rig.beam.length
    ground = -assembler.scene.background.distance_mm * MILLIMETRE
    bodies = {name: _coloured(name, s) for name, s in surfaces.items() if name not in _LEFT_OUT}
    if "background_squares" not in bodies:
        table = _table(surfaces["background"], length)
        bodies["background"] = ColouredBody(table, _COLOURS["background"])
    pose = invert(assembler.rig.camera.camera_from_antenna)
    body, lens, stand = _camera(pose, length, ground)
    bodies["camera"] = _new(body, _DARK, "gloss")
    bodies["lens"] = _new(lens, _DARK, "gloss", 0.15)
    bodies["stand"] = _new(stand, _STEEL, "bare", 0.25)
    bodies["motor"] = _new(_motor(assembler, length, ground), _STEEL, "gloss")
    for number, light in enumerate(lights):
        lamp = light.sheet
        if lamp is not None and lamp.mesh.vertices[:, 2].min() > 0:
            housing = _housing(lamp.mesh, length, ground)
            bodies[f"housing_{number}"] = _new(housing, _HOUSING, "matt")
    return bodies


# The table replaces them: from outside its edge is in view in any case.
_LEFT_OUT: Final = {"table_side", "floor"}


def viewpoint(assembler: SceneAssembler) -> Viewpoint:
    """Choose where to look from: down to the beam and its contact, past the camera's lens."""
    length = assembler.rig.beam.length
    height = float(invert(assembler.rig.camera.camera_from_antenna)[2, 3])
    top = height + (_CAMERA_DEPTH + _LENS_LENGTH) * length
    target = np.array([0.48 * length, 0.1 * length, 0.30 * top])
    position = np.array([1.67 * length, -2.56 * length, 1.01 * top])
    return Viewpoint(position, target, 35.0)


def _new(mesh: trimesh.Trimesh, colour: Colour, paint: str, roughness: float = 0.3) -> ColouredBody:
    return ColouredBody(Surface(mesh, 0.5, paint, roughness=roughness), colour)


def _coloured(name: str, surface: Surface) -> ColouredBody:
    colours = None
    if name.startswith("clutter") and surface.texture is not None:
        count = surface.texture.image.shape[1]
        colours = _THINGS[np.arange(count) % len(_THINGS)]
    if name == "beam":
        surface = replace(surface, texture=None, around=None)
    return ColouredBody(surface, _COLOURS.get(name, _STEEL), colours)


def _table(ground: Surface, length: float) -> Surface:
    """Replace the endless ground by a board; its texture stays where it is."""
    corners = np.asarray(ground.mesh.vertices)
    top = float(corners[0, 2])
    half = np.array(_TABLE) * length / 2
    middle = np.array([length / 2, 0.15 * length])
    board = box(
        np.array([*(middle - half), top - _THICKNESS * length]), np.array([*(middle + half), top])
    )
    texture = ground.texture
    if texture is not None:
        ones = np.ones((4, 1))
        mapping, *_ = np.linalg.lstsq(np.hstack([corners[:, :2], ones]), texture.uv, rcond=None)
        vertices = np.asarray(board.vertices)
        places = np.hstack([vertices[:, :2], np.ones((len(vertices), 1))])
        texture = replace(texture, uv=places @ mapping)
    return Surface(board, ground.reflectance, texture=texture)


def _camera(
    antenna_from_camera: Floats, length: float, ground: float
) -> tuple[trimesh.Trimesh, trimesh.Trimesh, trimesh.Trimesh]:
    """Mesh a camera's body, its lens, whose front is at the pinhole, and a stand."""
    half, depth, reach = _CAMERA_SIDE * length / 2, _CAMERA_DEPTH * length, _LENS_LENGTH * length
    body = box(np.array([-half, -half, -reach - depth]), np.array([half, half, -reach]))
    share = np.array([0.8, 0.8, 1.0, 1.0, 0.92, 0.85, 0.6, 0.0])
    along = np.array([-1.0, -0.75, -0.7, -0.1, 0.0, 0.0, -0.15, -0.2])
    lens = turned(share[:-1, None] * _LENS_RADIUS * length * np.ones(_SIDES), along[:-1] * reach)
    for mesh in (body, lens):
        mesh.vertices = apply(antenna_from_camera, np.asarray(mesh.vertices))
    back = apply(antenna_from_camera, np.array([[0.0, 0.0, -reach - depth / 2]]))[0]
    foot = np.array([back[0], back[1] + _POLE_AWAY * length, ground])
    top = np.array([*foot[:2], back[2] + 2.5 * half])
    radius = _POLE * length
    pole, arm = rod(foot, top, radius), rod(back, np.array([*foot[:2], back[2]]), 0.7 * radius)
    base = turned(
        np.array([6.0, 6.0, 5.6])[:, None] * radius * np.ones(_SIDES),
        np.array([0.0, 0.8, 1.0]) * radius,
    )
    base.apply_translation(foot)
    return body, lens, together([pole, arm, base])


def _motor(assembler: SceneAssembler, length: float, ground: float) -> trimesh.Trimesh:
    """Mesh a motor's housing about the hub, below the clamp."""
    offset = np.array([*assembler.scene.clamp_offset_mm[:2], 0.0]) * MILLIMETRE
    radius, top = _MOTOR * length, 0.45 * ground
    radii = np.array([1.0, 1.0, 0.93, 0.93, 1.0, 1.0, 0.92])[:, None] * radius * np.ones(_SIDES)
    heights = ground + (top - ground) * np.array([0.0, 0.25, 0.27, 0.7, 0.72, 0.95, 1.0])
    body = turned(radii, heights)
    body.apply_translation(assembler.rig.base_position * [1, 1, 0] - offset)
    return body


def _housing(panel: trimesh.Trimesh, length: float, ground: float) -> trimesh.Trimesh:
    """Mesh a box behind a luminous panel, on a pole."""
    corners = np.asarray(panel.vertices)
    middle = corners.mean(axis=0)
    normal = np.asarray(panel.face_normals)[0]
    first, second, ahead = sheets.axes(normal, corners[1 % len(corners)] - corners[0])
    frame = np.column_stack([first, second, ahead])
    half = np.abs((corners - middle) @ frame).max(axis=0)[:2] + _RIM * length
    body = box(np.array([*-half, -_DEPTH * length]), np.array([*half, -_BEHIND * length]))
    body.vertices = middle + np.asarray(body.vertices) @ frame.T
    back = middle - _DEPTH * length / 2 * ahead
    return together([body, rod(np.array([*back[:2], ground]), back, 0.6 * _POLE * length)])
