"""Any closed mesh in a file."""

from functools import lru_cache
from typing import Final, Literal, NamedTuple

import numpy as np
from pydantic import Field

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.mechanics.surfaces import Ball, Line, Solid
from vbaa_bench.scene.files import MeshName
from vbaa_bench.scene.objects.object import FileMesh, ObjectSetting, TouchedKind
from vbaa_bench.scene.part import Positive, Turn

# Allowed extent of a mesh, in beam radii. Outside this range a wrong unit is likely.
MIN_EXTENT: Final = 0.5
MAX_EXTENT: Final = 2000.0


class PlacedMesh(NamedTuple):
    """Mesh in the object's frame [m], and `object_from_file` (4, 4), its pose there."""

    mesh: Mesh
    object_from_file: Floats


class MeshSpec(TouchedKind):
    """Any closed mesh in an STL, OBJ or PLY file; its path is relative to the scene's folder.

    Its +y axis points to the beam and +z to the camera. It is turned by `turn_deg` about +z, moved
    along y until it touches a straight beam, and along x until it does so at the contact distance.
    """

    kind: Literal["mesh"]
    file: MeshName = Field(description="STL, OBJ or PLY file in the scene's folder.")
    unit_mm: Positive = Field(default=1.0, description="Length of the unit of the file.")
    # Drawn for every push, this is an antenna that is carried about one object: see `carriage`.
    turn_deg: Turn = Field(default=0.0, description="Turn of the mesh about +z.")

    def surface(self, setting: ObjectSetting) -> Solid:
        """Return the edges and corners of the mesh."""
        return Solid(self.mesh(setting))

    def mesh(self, setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Read the mesh, and place it. Raises SceneFileError, and InputError for its size."""
        copy: Mesh = self._placed(setting).mesh.copy()
        return copy

    def object_from_table(self, setting: ObjectSetting) -> Floats:
        """Compute the pose of the mesh's file in the object's frame."""
        return self._placed(setting).object_from_file

    def _placed(self, setting: ObjectSetting) -> PlacedMesh:
        file = setting.files.mesh(self.file, self.unit_mm * MILLIMETRE)
        return _placed(file, self.turn_deg * DEGREE, setting.beam_radius)


@lru_cache(maxsize=4)
def _placed(file: FileMesh, turn: float, beam_radius: float) -> PlacedMesh:
    """Turn a mesh about z, and move its first contact with a beam along x to its frame's origin.

    Raises InputError if its size is implausible.
    """
    object_from_file = turn_about_z(turn)
    turned = file.mesh.copy()
    if turn:
        turned.vertices = apply(object_from_file, np.asarray(turned.vertices))
    before = turned.vertices[0]
    mesh = touching(turned, beam_radius)
    extent = float(mesh.extents.max())
    if not MIN_EXTENT * beam_radius < extent < MAX_EXTENT * beam_radius:
        raise InputError(
            f"{file.path}: is {extent / MILLIMETRE:.4g} mm across, for a beam of "
            f"{2 * beam_radius / MILLIMETRE:.4g} mm; check object.unit_mm"
        )
    low, high = (float(x) for x in mesh.bounds[:, 0])
    along = np.linspace(low, high, 1001)
    beam = np.column_stack([along, np.full(1001, beam_radius), np.zeros(1001)])
    part = Solid(mesh).touched_by(beam)
    assert isinstance(part, Line | Ball)
    point = part.point
    if isinstance(part, Line):  # the point on the edge that is nearest to the beam
        across = part.direction[1:]
        squared = float(across @ across)
        fraction = float((beam[0, 1:] - point[1:]) @ across) / squared if squared > 0 else 0.0
        point = point + fraction * part.direction
    mesh.apply_translation([-point[0], 0.0, 0.0])
    object_from_file[:3, 3] = mesh.vertices[0] - before
    return PlacedMesh(mesh, object_from_file)


def touching(mesh: Mesh, beam_radius: float) -> Mesh:
    """Move a mesh along y so that a beam coming from +y just touches it.

    The beam is a round rod of `beam_radius` [m] along all of x, at y = beam_radius, z = 0.
    Raises InputError if the mesh is beside the beam's path.
    """
    # Only the mesh's projection along x on the y-z plane counts; its rim consists of edges.
    ends = np.asarray(mesh.vertices)[mesh.edges_unique]
    rise, run = (ends[:, 1] - ends[:, 0])[:, 1:].T
    low, high = np.sort(ends[:, :, 2], axis=1).T
    # An edge along x or y adds nothing to the projection that the ends of other edges do not.
    below = (run != 0) & (low < beam_radius) & (high > -beam_radius)
    if not below.any():
        bottom, top = mesh.bounds[:, 2] / MILLIMETRE
        raise InputError(
            f"the object's mesh spans z = {bottom:g} to {top:g} mm, beside the beam,"
            f" allowed is one that reaches within {beam_radius / MILLIMETRE:g} mm of z = 0"
        )
    ends, rise, run, low, high = (part[below] for part in (ends, rise, run, low, high))
    # The gap is convex along an edge: least where the beam's underside has the edge's slope.
    tangent_z = beam_radius * rise * np.sign(run) / np.hypot(rise, run)
    z = np.clip(tangent_z, np.maximum(low, -beam_radius), np.minimum(high, beam_radius))
    fraction = (z - ends[:, 0, 2]) / run
    underside = beam_radius - np.sqrt((beam_radius - z) * (beam_radius + z))
    gap = underside - (ends[:, 0, 1] + fraction * rise)
    moved: Mesh = mesh.copy()
    moved.apply_translation([0.0, gap.min(), 0.0])
    return moved
