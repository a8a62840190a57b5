"""A Mitsuba scene that is loaded once; afterwards only vertices move.

Mitsuba displaces rays from surfaces by about 1e-4 of the coordinates' size, whatever the unit:
in metres that would be a quarter of the beam's radius. So the scene is built in units of that
radius, with the origin at the beam's middle.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import mitsuba as mi
import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from vbaa_bench.render.camera import sensor_dict


@dataclass(frozen=True)
class Surface:
    """A mesh (in Sigma_a, metres) and its paint: matt, or gloss for painted steel.

    `arc_length` (vertices,) [m] is given for the beam alone.
    """

    mesh: trimesh.Trimesh
    reflectance: float
    paint: Literal["matt", "gloss"] = "matt"
    arc_length: Floats | None = None


@dataclass(frozen=True)
class Lamp:
    """A sheet that shines evenly from its facing side."""

    mesh: trimesh.Trimesh


@dataclass(frozen=True)
class RenderUnit:
    """Render coordinates are (metres - origin) / unit."""

    unit: float
    origin: Floats

    @property
    def render_from_antenna(self) -> Floats:
        """The similarity as a matrix (4, 4)."""
        matrix = np.diag([1 / self.unit, 1 / self.unit, 1 / self.unit, 1.0])
        matrix[:3, 3] = -self.origin / self.unit
        return matrix

    def __call__(self, vertices: Floats) -> Floats:
        """Vertices (n, 3) [m] in render coordinates."""
        return np.asarray((vertices - self.origin) / self.unit)


class World:
    """Surfaces under a lamp before a camera.

    `variant` must be set in Mitsuba beforehand (`mi.set_variant`). The index of a surface in the
    truth layers is its place in `surfaces`, from 1; 0 is nothing.
    """

    def __init__(
        self, camera: Camera, lamp: Lamp, surfaces: Mapping[str, Surface], unit: RenderUnit
    ) -> None:
        self.camera = camera
        self.unit = unit
        self.names = tuple(surfaces)
        self._meshes = {name: _mesh(name, surface, unit) for name, surface in surfaces.items()}
        self._vertex_counts = {name: len(s.mesh.vertices) for name, s in surfaces.items()}
        sensor = sensor_dict(camera, unit.render_from_antenna)
        sensor["to_world"] = mi.ScalarTransform4f(sensor["to_world"])
        self.scene = mi.load_dict(
            {
                "type": "scene",
                "sensor": sensor,
                "lamp": _lamp(lamp, unit),
                # One bounce: lamp, surface, camera. No scene asks for interreflection yet.
                "integrator": {"type": "path", "max_depth": 2},
                **self._meshes,
            }
        )
        self.sensor = self.scene.sensors()[0]
        self.integrator = self.scene.integrator()
        self.parameters = mi.traverse(self.scene)

    def shape(self, name: str) -> Any:
        """Mitsuba's shape of a surface."""
        return self._meshes[name]

    def move(self, vertices: Mapping[str, Floats], arc_length: Floats | None = None) -> None:
        """New vertices (n, 3) [m] for some surfaces, and with them the beam's arc lengths [m].

        The topology stays; raises ValueError if the number of vertices does not.
        """
        for name, new in vertices.items():
            if len(new) != self._vertex_counts[name]:
                raise ValueError(
                    f"{name} has {self._vertex_counts[name]} vertices, given were {len(new)}"
                )
            self.parameters[f"{name}.vertex_positions"] = _flat(self.unit(new))
        if arc_length is not None:
            self.parameters["beam.vertex_texcoords"] = _flat(_texcoords(arc_length))
        self.parameters.update()


def _mesh(name: str, surface: Surface, unit: RenderUnit) -> Any:
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(_paint(surface))
    properties["face_normals"] = True
    vertices, faces = surface.mesh.vertices, surface.mesh.faces
    textured = surface.arc_length is not None
    mesh = mi.Mesh(name, len(vertices), len(faces), props=properties, has_vertex_texcoords=textured)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = _flat(unit(np.asarray(vertices)))
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    if surface.arc_length is not None:
        parameters["vertex_texcoords"] = _flat(_texcoords(surface.arc_length))
    parameters.update()
    return mesh


def _paint(surface: Surface) -> dict[str, Any]:
    colour = {"type": "rgb", "value": surface.reflectance}
    if surface.paint == "matt":
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": colour}}
    return {"type": "roughplastic", "diffuse_reflectance": colour, "alpha": 0.3}


def _lamp(lamp: Lamp, unit: RenderUnit) -> Any:
    properties = mi.Properties()
    properties["mesh_emitter"] = mi.load_dict(
        {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
    )
    vertices, faces = lamp.mesh.vertices, lamp.mesh.faces
    mesh = mi.Mesh("lamp", len(vertices), len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = _flat(unit(np.asarray(vertices)))
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    parameters.update()
    return mesh


def _texcoords(arc_length: Floats) -> Floats:
    """Arc length in millimetres as the first texture coordinate."""
    return np.column_stack([arc_length * 1e3, np.zeros_like(arc_length)])


def _flat(values: Floats) -> Any:
    return np.ascontiguousarray(values, dtype=np.float32).ravel()
