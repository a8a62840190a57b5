"""Lights as Mitsuba's emitters. Positions are in Sigma_a, in metres.

Only the ratios between lights matter, because the camera's exposure is metered on the beam.
Radiance and irradiance are therefore in one arbitrary unit. Every light is one emitter, which a
point of the unit square samples smoothly.
"""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply
from vbaa_bench.render.loading import load

# Fraction of a spot's cone beyond which its intensity fades.
UNIFORM_FRACTION = 0.75


@dataclass(frozen=True)
class Lamp:
    """A sheet that emits a uniform `radiance` from its front side."""

    mesh: trimesh.Trimesh
    radiance: float = 1.0


@dataclass(frozen=True)
class Spot:
    """A point source that lights a cone of full angle `cone` [rad] about its aim.

    `position` and `aim` are (3,); `irradiance` is that on a sheet at the aim that faces the spot.
    """

    position: Floats
    aim: Floats
    cone: float
    irradiance: float


@dataclass(frozen=True)
class Projector:
    """A point source that projects a slide, the `image` (height, width) of transmittances.

    On a sheet at `aim` (3,) that faces the projector, the slide is `width` [m] wide and its rows
    run along `along` (3,).
    """

    position: Floats
    aim: Floats
    along: Floats
    width: float
    image: Floats
    irradiance: float


@dataclass(frozen=True)
class Environment:
    """Infinitely distant light from all directions: `image` (height, width) of radiances.

    The first row is at +z, straight up, the last straight down; columns run from +x through +y
    around.
    """

    image: Floats


@dataclass(frozen=True)
class Ambient:
    """Infinitely distant light of the same `radiance` from all directions."""

    radiance: float


Light = Lamp | Spot | Projector | Environment | Ambient


def emitter(light: Light, render_from_antenna: Floats) -> Any:
    """Return Mitsuba's description of a light.

    `render_from_antenna` (4, 4) is a uniform scale and a shift.
    """
    match light:
        case Lamp():
            return _lamp(light, render_from_antenna)
        case Spot():
            return _spot(light, render_from_antenna)
        case Projector():
            return _projector(light, render_from_antenna)
        case Environment():
            return _environment(light)
        case Ambient():
            return {"type": "constant", "radiance": {"type": "rgb", "value": light.radiance}}


def _lamp(lamp: Lamp, render_from_antenna: Floats) -> Any:
    vertices, faces = np.asarray(lamp.mesh.vertices), lamp.mesh.faces
    glow = {"type": "area", "radiance": {"type": "rgb", "value": lamp.radiance}}
    pose = rectangle(lamp, render_from_antenna)
    if pose is not None:
        # Mitsuba samples a rectangle as one shape, but two triangles separately.
        return {"type": "rectangle", "to_world": _transform(pose), "emitter": glow}
    corners = apply(render_from_antenna, vertices)
    properties = mi.Properties()
    properties["mesh_emitter"] = load(glow)
    mesh = mi.Mesh("lamp", len(vertices), len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(corners, dtype=np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    parameters.update()
    return mesh


def rectangle(lamp: Lamp, render_from_antenna: Floats) -> Floats | None:
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


def _spot(spot: Spot, render_from_antenna: Floats) -> dict[str, Any]:
    position, aim = apply(render_from_antenna, np.array([spot.position, spot.aim]))
    distance = float(np.linalg.norm(aim - position))
    half = float(np.rad2deg(spot.cone / 2))
    # A cone is round: any direction not parallel to its axis will do.
    across = np.eye(3)[np.abs(aim - position).argmin()]
    return {
        "type": "spot",
        # Intensity is per solid angle: the distance must be in render coordinates.
        "intensity": {"type": "rgb", "value": spot.irradiance * distance**2},
        "cutoff_angle": half,
        "beam_width": UNIFORM_FRACTION * half,
        "to_world": _transform(_pose_towards(position, aim, across)),
    }


def _projector(slide: Projector, render_from_antenna: Floats) -> dict[str, Any]:
    position, aim = apply(render_from_antenna, np.array([slide.position, slide.aim]))
    distance = float(np.linalg.norm(slide.aim - slide.position))
    render_distance = float(np.linalg.norm(aim - position))
    image = np.ascontiguousarray(slide.image[:, :, None], dtype=np.float32)
    return {
        "type": "projector",
        # Mitsuba's factor: irradiance at the distance z is pi scale / z^2.
        "irradiance": _bitmap(image),
        "scale": slide.irradiance * render_distance**2 / np.pi,
        "fov": float(np.rad2deg(2 * np.arctan2(slide.width / 2, distance))),
        "fov_axis": "x",
        "to_world": _transform(_pose_towards(position, aim, slide.along)),
    }


def _environment(environment: Environment) -> dict[str, Any]:
    # Mitsuba's map has y up, and its columns run in the opposite direction.
    image = np.ascontiguousarray(environment.image[:, ::-1, None], dtype=np.float32)
    turn = np.eye(4)
    turn[:3, :3] = [[0, 0, -1], [-1, 0, 0], [0, 1, 0]]
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(image),
        "to_world": _transform(turn),
    }


def _bitmap(image: np.ndarray) -> dict[str, Any]:
    return {"type": "bitmap", "bitmap": mi.Bitmap(image), "raw": True, "wrap_mode": "clamp"}


def _pose_towards(position: Floats, aim: Floats, along: Floats) -> Floats:
    """Compute world_from_emitter (4, 4): +z towards the aim, the slide's rows along `along`."""
    ahead = (aim - position) / np.linalg.norm(aim - position)
    across = along - (along @ ahead) * ahead
    # Mitsuba's x points to the left when looking along +z.
    left = -across / np.linalg.norm(across)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([left, np.cross(ahead, left), ahead])
    pose[:3, 3] = position
    return pose


def _transform(matrix: Floats) -> Any:
    return mi.ScalarTransform4f(matrix.tolist())
