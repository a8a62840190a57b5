"""A scene's objects as contact surfaces, for mechanics, and as meshes, for rendering."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply, rigid, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.assembly.mesh_file import read_mesh, touching
from vbaa_bench.dataset.scene_files import FileVersion, file_version, read_version
from vbaa_bench.geometry import objects
from vbaa_bench.geometry.weight import weight
from vbaa_bench.mechanics.surfaces import Ball, Flat, Line, Solid, Surface, ball, upright
from vbaa_bench.scene.objects import (
    BlockSpec,
    CylinderSpec,
    KnifeEdgeSpec,
    MeshSpec,
    NothingSpec,
    ObjectSpec,
    PadSpec,
    PegSpec,
    PlungerSpec,
    SphereSpec,
    UprightSpec,
    WallSpec,
)
from vbaa_bench.scene.weight import WeightSpec

# Allowed extent of a mesh, in beam radii. Outside this range a wrong unit is likely.
MIN_EXTENT, MAX_EXTENT = 0.5, 2000.0


class PlacedMesh(NamedTuple):
    """Mesh in the object's frame [m], and `object_from_file` (4, 4), its pose there."""

    mesh: trimesh.Trimesh
    object_from_file: Floats


@dataclass(frozen=True)
class Body:
    """An object of a scene for a beam of radius `beam_radius` [m].

    It stands on the `ground` [m], unless its spec sets its bottom. A mesh file is looked up
    relative to `folder`.
    """

    spec: ObjectSpec
    beam_radius: float
    ground: float
    folder: Path

    @property
    def _heights(self) -> tuple[float, float]:
        """Bottom and top [m] of an upright object."""
        assert isinstance(self.spec, UprightSpec)
        bottom = self.spec.bottom_mm
        return (
            self.ground if bottom is None else bottom * MILLIMETRE,
            self.spec.top_mm * MILLIMETRE,
        )

    def surface(self) -> Surface:
        """Build the contact surface in the object's frame. Raises InputError if a mesh is bad."""
        match self.spec:
            case CylinderSpec() | PegSpec():
                return upright(self.spec.radius_mm * MILLIMETRE)
            case PlungerSpec():
                return upright(self.spec.nose_radius_mm * MILLIMETRE)
            case PadSpec():
                return upright(self.spec.face_radius_mm * MILLIMETRE)
            case SphereSpec():
                return ball(self.spec.radius_mm * MILLIMETRE)
            case WallSpec():
                return Flat()
            case MeshSpec():
                return Solid(self.mesh(0.0))
            case BlockSpec() | KnifeEdgeSpec() | NothingSpec() | WeightSpec():
                return upright()

    def misses(self, touched: Floats, tangent: Floats) -> str | None:
        """Explain why a beam cannot touch the object at a point (3,) [m] with a given tangent.

        Both are in the object's frame. Mechanics models an infinite edge, cylinder or wall. Return
        None if the beam can touch the finite object there.
        """
        mm, spec, x, z = MILLIMETRE, self.spec, float(touched[0]), float(touched[2])
        low, high, half, flank, chamfer = -np.inf, np.inf, np.inf, np.pi / 2, 0.0
        match spec:
            case KnifeEdgeSpec():
                low, high = -spec.length_mm * mm / 2, spec.length_mm * mm / 2
                flank = np.pi / 2 - spec.half_angle_deg * DEGREE
            case BlockSpec():
                flank, chamfer = np.pi / 4, spec.chamfer_mm * mm
            case WallSpec():
                half = spec.length_mm * mm / 2
            case PadSpec():
                half = spec.width_mm * mm / 2
        if isinstance(spec, UprightSpec):
            low, high = self._heights
            high -= chamfer
        if not low <= z <= high:
            return (
                f"the beam slides off the end of the object, to {z / mm:.3g} mm along its edge, "
                f"allowed is {low / mm:.4g} to {high / mm:.4g} mm"
            )
        if abs(x) > half:
            return (
                f"the beam touches {abs(x) / mm:.4g} mm from the object's middle, "
                f"allowed is up to {half / mm:.4g} mm"
            )
        inclination = abs(float(np.arctan2(tangent[1], tangent[0])))
        if inclination > flank:
            return (
                f"the beam leans by {inclination / DEGREE:.3g} degrees, into the object's flank, "
                f"allowed is {flank / DEGREE:.3g}"
            )
        return None

    def mesh(self, give: float, slope: float = 0.0) -> trimesh.Trimesh:
        """Build the mesh for rendering, in the object's frame [m].

        The object is deformed by `give` [m] by a beam of the given slope against its x axis.
        """
        mm, spec = MILLIMETRE, self.spec
        match spec:
            case BlockSpec():
                return objects.block(spec.side_mm * mm, *self._heights, spec.chamfer_mm * mm)
            case CylinderSpec() | PegSpec():
                return objects.cylinder(spec.radius_mm * mm, *self._heights)
            case SphereSpec():
                return objects.sphere(spec.radius_mm * mm)
            case KnifeEdgeSpec():
                return objects.knife_edge(
                    spec.length_mm * mm, spec.depth_mm * mm, spec.half_angle_deg * DEGREE
                )
            case WallSpec():
                return objects.wall(
                    spec.length_mm * mm,
                    spec.thickness_mm * mm,
                    *self._heights,
                )
            case PlungerSpec():
                return objects.plunger(
                    spec.nose_radius_mm * mm,
                    give,
                    spec.free_length_mm * mm,
                    *self._heights,
                )
            case PadSpec():
                return objects.pad(
                    spec.width_mm * mm,
                    spec.thickness_mm * mm,
                    spec.face_radius_mm * mm,
                    *self._heights,
                    give,
                    self.beam_radius,
                    slope,
                )
            case MeshSpec():
                return self._placed_mesh(spec).mesh.copy()
            case WeightSpec():
                return weight(
                    self.beam_radius,
                    slope,
                    spec.thread_diameter_mm * mm / 2,
                    spec.thread_length_mm * mm,
                    spec.weight_diameter_mm * mm / 2,
                    spec.weight_height_mm * mm,
                )
            case NothingSpec():
                raise ValueError("no mesh to build")

    def object_from_table(self) -> Floats:
        """Compute the pose (4, 4) of the object's table in the object's frame.

        The object is fixed on the table, whose frame is that of the mesh's file; for other objects
        it is the object's own.
        """
        spec = self.spec
        return self._placed_mesh(spec).object_from_file if isinstance(spec, MeshSpec) else np.eye(4)

    def _placed_mesh(self, spec: MeshSpec) -> PlacedMesh:
        file, unit = file_version(self.folder, spec.file), spec.unit_mm * MILLIMETRE
        return _placed_mesh(file, unit, spec.turn_deg * DEGREE, self.beam_radius)


@lru_cache(maxsize=4)
def _from_file(file: FileVersion, unit: float) -> trimesh.Trimesh:
    return read_mesh(read_version(file, "mesh"), unit)


@lru_cache(maxsize=4)
def _placed_mesh(file: FileVersion, unit: float, turn: float, beam_radius: float) -> PlacedMesh:
    """Turn a mesh about z, and move its first contact with a beam along x to its frame's origin.

    Raises SceneFileError if the file is unusable, InputError if its size is implausible.
    """
    object_from_file = turn_about_z(turn)
    turned = _from_file(file, unit).copy()
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


def place(at: Floats, tangent: Floats, tilt: float, reach: float) -> Floats:
    """Compute world_from_object (4, 4) of an object that touches the beam at rest.

    The beam's centreline passes through `at` (3,) [m] along `tangent` (3,). The object's edge, its
    z axis, is tilted by `tilt` [rad] from upright; its outward normal is perpendicular to both. The
    beam's surface is `reach` [m] from the centreline.
    """
    edge = np.array([0.0, -np.sin(tilt), np.cos(tilt)])
    outward = np.cross(edge, tangent)
    outward /= np.linalg.norm(outward)
    pose = rigid(np.zeros(3), at - reach * outward)
    pose[:3, :3] = np.column_stack([np.cross(outward, edge), outward, edge])
    return pose


def hanging(at: Floats, tangent: Floats, force: Floats) -> Floats:
    """Compute clamp_from_object (4, 4) of a weight that pulls at `at` (3,) [m] with `force` (3,).

    Its y axis is up; its x axis is the beam's `tangent` (3,), made level.
    """
    up = -force / np.linalg.norm(force)
    level = tangent - (tangent @ up) * up
    level /= np.linalg.norm(level)
    pose = rigid(np.zeros(3), at)
    pose[:3, :3] = np.column_stack([level, up, np.cross(level, up)])
    return pose
