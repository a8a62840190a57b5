"""A mesh with its paint, the unit of render coordinates, and Mitsuba's mesh of both."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from vbaa_bench.geometry.textures import Texture
from vbaa_bench.geometry.tube import normals
from vbaa_bench.render.device_array import device_array
from vbaa_bench.render.loading import load
from vbaa_bench.render.materials import bsdf
from vbaa_bench.scene.paint import Paint, PaintedPart


@dataclass(frozen=True)
class RenderUnit:
    """The unit and origin of render coordinates, which are (metres - origin) / unit."""

    unit: float
    origin: Floats

    @classmethod
    def of(cls, beam: Beam) -> "RenderUnit":
        """Return the unit in which a beam is rendered: its radius, about its middle."""
        return cls(beam.radius, np.array([beam.length / 2, 0.0, 0.0]))

    @property
    def render_from_antenna(self) -> Floats:
        """The similarity as a matrix (4, 4)."""
        matrix = np.diag([1 / self.unit, 1 / self.unit, 1 / self.unit, 1.0])
        matrix[:3, 3] = -self.origin / self.unit
        return matrix

    def __call__(self, vertices: Floats) -> Floats:
        """Vertices (n, 3) [m] in render coordinates."""
        return np.asarray((vertices - self.origin) / self.unit)


@dataclass(frozen=True)
class Surface:
    """A mesh (in Sigma_a, metres) and its paint; see scene/paint.py.

    Only the beam has an `arc_length` (vertices,) [m]; with a texture it also has the place
    `around` (vertices,) it, from 0 to 1. A `smooth` beam is a tube, shaded as the smooth surface
    through its vertices, up to an `oblique_tip`; faces of other surfaces are flat.
    """

    mesh: trimesh.Trimesh
    reflectance: float
    paint: Paint = "matt"
    arc_length: Floats | None = None
    smooth: bool = False
    roughness: float = 0.3
    texture: Texture | None = None
    around: Floats | None = None
    oblique_tip: bool = False

    @classmethod
    def of(cls, mesh: trimesh.Trimesh, part: PaintedPart) -> "Surface":
        """Combine a mesh with the paint of a part."""
        return cls(mesh, part.reflectance, part.paint, roughness=part.roughness)

    @property
    def texcoords(self) -> Floats | None:
        """Texture coordinates (vertices, 2): the texture's, or those of a beam."""
        if self.arc_length is not None:
            return self.beam_texcoords(self.arc_length)
        return None if self.texture is None else self.texture.uv

    def beam_texcoords(self, arc_length: Floats) -> Floats:
        """Convert arc lengths (vertices,) [m] to coordinates: millimetres, and the place around."""
        around = np.zeros_like(arc_length) if self.around is None else self.around
        return np.column_stack([arc_length * 1e3, around])

    @property
    def facets(self) -> int:
        """Number of vertices of a ring of the beam: they have one arc length, one after another."""
        s = self.arc_length
        return 0 if s is None else int(np.argmax(s != s[0]))

    def shape(self, vertices: Floats, unit: RenderUnit) -> dict[str, Any]:
        """Return Mitsuba's parameters of this surface with new vertices (n, 3) [m]."""
        parameters = {"vertex_positions": device_array(unit(vertices))}
        if self.smooth:
            parameters["vertex_normals"] = device_array(
                normals(vertices, self.facets, oblique_tip=self.oblique_tip)
            )
        return parameters


def painted_meshes(surfaces: Mapping[str, Surface], unit: RenderUnit) -> dict[str, Any]:
    """Build Mitsuba's meshes of surfaces with their own paint."""
    meshes = {}
    for name, surface in surfaces.items():
        paint = bsdf(surface.paint, surface.reflectance, surface.roughness, surface.texture)
        meshes[name] = mitsuba_mesh(name, surface, unit, paint)
    return meshes


def mitsuba_mesh(name: str, surface: Surface, unit: RenderUnit, paint: dict[str, Any]) -> Any:
    """Build Mitsuba's mesh of a surface with a paint that replaces its own."""
    properties = mi.Properties()
    properties["mesh_bsdf"] = load(paint)
    properties["face_normals"] = not surface.smooth
    vertices, faces = np.asarray(surface.mesh.vertices), surface.mesh.faces
    texcoords = surface.texcoords
    mesh = mi.Mesh(
        name,
        len(vertices),
        len(faces),
        props=properties,
        has_vertex_normals=surface.smooth,
        has_vertex_texcoords=texcoords is not None,
    )
    parameters = mi.traverse(mesh)
    for key, value in surface.shape(vertices, unit).items():
        parameters[key] = value
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    if texcoords is not None:
        parameters["vertex_texcoords"] = device_array(texcoords)
    parameters.update()
    return mesh
