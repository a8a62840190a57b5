"""Lights as Mitsuba's emitters."""

from typing import Any

import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply
from vbaa_bench.render.loading import load
from vbaa_bench.scene.lights.emitter import Emitter, Lamp


def emitter(light: Emitter, render_from_antenna: Floats) -> Any:
    """Return Mitsuba's description of a light.

    `render_from_antenna` (4, 4) is a uniform scale and a shift.
    """
    described = _in_mitsubas_types(light.description(render_from_antenna))
    return described if light.sheet is None else _sheet(light.sheet, described, render_from_antenna)


def _in_mitsubas_types(description: Any) -> Any:
    """Convert the poses (4, 4) and images (height, width, 1) of a description."""
    if isinstance(description, dict):
        return {name: _in_mitsubas_types(value) for name, value in description.items()}
    if not isinstance(description, np.ndarray):
        return description
    is_pose = description.shape == (4, 4)
    return mi.ScalarTransform4f(description.tolist()) if is_pose else mi.Bitmap(description)


def _sheet(lamp: Lamp, glow: dict[str, Any], render_from_antenna: Floats) -> Any:
    pose = rectangle_pose(lamp, render_from_antenna)
    if pose is not None:
        # Mitsuba samples a rectangle as one shape, but two triangles separately.
        to_world = mi.ScalarTransform4f(pose.tolist())
        return {"type": "rectangle", "to_world": to_world, "emitter": glow}
    vertices, faces = np.asarray(lamp.mesh.vertices), lamp.mesh.faces
    corners = apply(render_from_antenna, vertices)
    properties = mi.Properties()
    properties["mesh_emitter"] = load(glow)
    mesh = mi.Mesh("lamp", len(vertices), len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(corners, dtype=np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    parameters.update()
    return mesh


def rectangle_pose(lamp: Lamp, render_from_antenna: Floats) -> Floats | None:
    """Compute the pose (4, 4) of a lamp as Mitsuba's rectangle; None if it has another shape.

    The rectangle spans -1..1 in x and y and faces +z.
    """
    if len(lamp.mesh.vertices) != 4:
        return None
    first, second, third = apply(render_from_antenna, lamp.mesh.vertices[lamp.mesh.faces[0]])
    pose = np.eye(4)
    pose[:3, 0] = (second - first) / 2
    pose[:3, 1] = (third - second) / 2
    normal = np.cross(pose[:3, 0], pose[:3, 1])
    pose[:3, 2] = normal / np.linalg.norm(normal)
    pose[:3, 3] = (first + third) / 2
    return pose
