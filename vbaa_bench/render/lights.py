"""Lights as Mitsuba's emitters. Places are in Sigma_a, in metres.

Only the ratios between lights matter: the camera's exposure follows the beam. So radiance and
irradiance are in any one unit. Every light is one emitter, which a point of the unit square samples
smoothly.
"""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply

# A spot's rim fades from this share of its cone outwards.
EVEN_SHARE = 0.75


@dataclass(frozen=True)
class Lamp:
    """A sheet that shines evenly, with `radiance`, from its facing side."""

    mesh: trimesh.Trimesh
    radiance: float = 1.0


@dataclass(frozen=True)
class Spot:
    """A point that lights a cone, half as wide as `cone` [rad], about its aim.

    `position` and `aim` (3,); `irradiance` is that of a sheet at the aim that faces the spot.
    """

    position: Floats
    aim: Floats
    cone: float
    irradiance: float


@dataclass(frozen=True)
class Projector:
    """A point that throws a slide: `image` (height, width) of transmittances on a sheet that faces
    it at `aim` (3,), `width` [m] wide there, whose rows run along `along` (3,)."""

    position: Floats
    aim: Floats
    along: Floats
    width: float
    image: Floats
    irradiance: float


@dataclass(frozen=True)
class Environment:
    """Light from all around and infinitely far: `image` (height, width) of radiances.

    The first row is straight up, +z, the last straight down; columns run from +x through +y around.
    """

    image: Floats


Light = Lamp | Spot | Projector | Environment


def emitter(light: Light, render_from_antenna: Floats) -> Any:
    """Mitsuba's description of a light, where `render_from_antenna` (4, 4) is a uniform scale and a
    shift."""
    match light:
        case Lamp():
            return _lamp(light, render_from_antenna)
        case Spot():
            return _spot(light, render_from_antenna)
        case Projector():
            return _projector(light, render_from_antenna)
        case Environment():
            return _environment(light)


def _lamp(lamp: Lamp, render_from_antenna: Floats) -> Any:
    vertices, faces = np.asarray(lamp.mesh.vertices), lamp.mesh.faces
    glow = {"type": "area", "radiance": {"type": "rgb", "value": lamp.radiance}}
    place = apply(render_from_antenna, vertices)
    if len(vertices) == 4:
        # Two triangles would be sampled apart, a rectangle as one.
        return {
            "type": "rectangle",
            "to_world": _transform(_rectangle(place, faces)),
            "emitter": glow,
        }
    properties = mi.Properties()
    properties["mesh_emitter"] = mi.load_dict(glow)
    mesh = mi.Mesh("lamp", len(vertices), len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(place, dtype=np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    parameters.update()
    return mesh


def _rectangle(corners: Floats, faces: np.ndarray) -> Floats:
    """Mitsuba's rectangle spans -1..1 in x and y and faces +z."""
    first, second, third = corners[faces[0]]
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
    # A cone is round: any direction that is not its own will do.
    slanting = np.eye(3)[np.abs(aim - position).argmin()]
    return {
        "type": "spot",
        # Intensity is per solid angle: in the renderer's unit it takes the distance there.
        "intensity": {"type": "rgb", "value": spot.irradiance * distance**2},
        "cutoff_angle": half,
        "beam_width": EVEN_SHARE * half,
        "to_world": _transform(_looking(position, aim, slanting)),
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
        "to_world": _transform(_looking(position, aim, slide.along)),
    }


def _environment(environment: Environment) -> dict[str, Any]:
    # Mitsuba's map has y up and runs the other way round.
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


def _looking(position: Floats, aim: Floats, along: Floats) -> Floats:
    """World_from_emitter (4, 4): +z towards the aim, the slide's rows along `along`."""
    ahead = (aim - position) / np.linalg.norm(aim - position)
    across = along - (along @ ahead) * ahead
    # Mitsuba's x runs to the left of who looks along +z.
    left = -across / np.linalg.norm(across)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([left, np.cross(ahead, left), ahead])
    pose[:3, 3] = position
    return pose


def _transform(matrix: Floats) -> Any:
    return mi.ScalarTransform4f(matrix.tolist())
