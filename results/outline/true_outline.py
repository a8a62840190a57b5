"""The true outline of a scene's object: the section of its mesh in plane C."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply, invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.mesh_file import SceneMeshes
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.objects.object import ObjectSetting
from vbaa_bench.scene.rigs import true_rig

# Distance of the points at which an outline is compared, over its length. Chosen: 2,000 points.
STEP: Final = 1 / 2000


class TrueOutline:
    """Section (m, 2, 2) [m] of an object's mesh with plane C, in the frame of its table."""

    def __init__(self, file: SceneFile) -> None:
        scene, folder = file.scene, Path(file.path).parent
        if not scene.object.present or scene.carriage is None:
            raise InputError(f"{file.path}: has no carriage, or no object, allowed are both")
        ground = -scene.background.distance_mm * MILLIMETRE
        setting = ObjectSetting(true_rig(scene).beam.radius, ground, SceneMeshes(folder))
        mesh = scene.object.mesh(setting)
        table_from_object = invert(scene.object.object_from_table(setting))
        mesh.vertices = apply(table_from_object, np.asarray(mesh.vertices))
        self.segments = _section(mesh)
        if not len(self.segments):
            raise InputError(f"{file.path}: the object does not reach plane C")

    def support(self, normals: Floats) -> Floats:
        """Compute the support function (n,) [m]: the extent along unit vectors (n, 2)."""
        return np.asarray((self.segments.reshape(-1, 2) @ normals.T).max(axis=0))

    def distances(self, points: Floats) -> Floats:
        """Compute the distances (n,) [m] of points (n, 2) from the section."""
        start, along = self.segments[:, 0], self.segments[:, 1] - self.segments[:, 0]
        squared = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
        from_start = points[:, None] - start
        share = np.clip((from_start * along).sum(axis=2) / squared, 0, 1)
        return np.asarray(np.linalg.norm(from_start - share[..., None] * along, axis=2).min(axis=1))


def _section(mesh: trimesh.Trimesh) -> Floats:
    """Cut a mesh with the plane z = 0; return the segments (m, 2, 2) [m]."""
    cut: Any = trimesh.intersections.mesh_plane
    segments = cut(mesh, [0.0, 0.0, 1.0], np.zeros(3))
    return np.asarray(segments, dtype=float)[:, :, :2]


def evenly(points: Floats, closed: bool) -> Floats:
    """Place points (m, 2) evenly along a polyline (n, 2), which may be closed."""
    line = np.vstack([points, points[:1]]) if closed else points
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    at = np.arange(0, 1, STEP) * length[-1]
    return np.column_stack([np.interp(at, length, line[:, i]) for i in (0, 1)])
