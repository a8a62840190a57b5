"""What a scene's objects are to the beam, as touched surfaces, and to the eye, as meshes."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import rigid
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry import objects
from vbaa_bench.geometry.mesh_file import read_mesh, touching
from vbaa_bench.mechanics.surfaces import Flat, Solid, Surface, ball, upright
from vbaa_bench.spec.objects import (
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


@dataclass(frozen=True)
class Body:
    """An object of a scene for a beam of radius `beam_radius` [m].

    It stands on the `ground` [m], unless it says where it ends; its mesh, if it comes from a file,
    is named from `folder`.
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
        """What the beam touches, in the object's frame. Raises InputError for a bad mesh file."""
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
            case BlockSpec() | KnifeEdgeSpec() | NothingSpec():
                return upright()

    def edge(self) -> tuple[float, float]:
        """From where to where [m] the touched edge reaches along the object's z axis."""
        mm, spec = MILLIMETRE, self.spec
        match spec:
            case SphereSpec():
                return -spec.radius_mm * mm, spec.radius_mm * mm
            case KnifeEdgeSpec():
                return -spec.length_mm * mm / 2, spec.length_mm * mm / 2
            case MeshSpec() | NothingSpec():
                return -np.inf, np.inf
            case _:
                return self._heights

    def mesh(self, give: float, slope: float = 0.0) -> trimesh.Trimesh:
        """What the camera sees, in the object's frame [m], after giving way by `give` [m] to a
        beam of the given slope against the object's x axis."""
        mm, spec = MILLIMETRE, self.spec
        match spec:
            case BlockSpec():
                return objects.block(spec.side_mm * mm, *self._heights)
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
                return _from_file(
                    self.folder / spec.file, spec.unit_mm * mm, self.beam_radius
                ).copy()
            case NothingSpec():
                raise ValueError("nothing has no mesh")


@lru_cache(maxsize=4)
def _from_file(path: Path, unit: float, beam_radius: float) -> trimesh.Trimesh:
    return touching(read_mesh(path, unit), beam_radius)


def place(at: Floats, tangent: Floats, normal: float, reach: float) -> Floats:
    """World_from_object (4, 4) of an object that touches the beam at rest.

    The beam's centreline passes `at` (3,) [m] along `tangent` (3,); the object's outward normal
    is tilted by `normal` [rad] out of plane C and across the beam, whose surface lies `reach` [m]
    from the centreline.
    """
    outward = np.array([0.0, np.cos(normal), np.sin(normal)])
    outward -= (outward @ tangent) * tangent
    outward /= np.linalg.norm(outward)
    pose = rigid(np.zeros(3), at - reach * outward)
    pose[:3, :3] = np.column_stack([tangent, outward, np.cross(tangent, outward)])
    return pose
