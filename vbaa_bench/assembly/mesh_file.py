"""Read a mesh of any shape from a user's file, and check it."""

import io
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from vbaa_bench.dataset.scene_files import FileVersion, file_version, read_version
from vbaa_bench.geometry.solids import together
from vbaa_bench.scene.files import FileContent, SceneFileError, unusable_file
from vbaa_bench.scene.objects.object import FileMesh

KINDS = (".stl", ".obj", ".ply")
# A file of this many faces has at most the bytes that scene/files.py allows.
MAX_FACES = 200_000
# Allowed extents [m] of an object.
MIN_EXTENT, MAX_EXTENT = 1e-9, 10.0


@dataclass(frozen=True)
class SceneMeshes:
    """Reader of the meshes that a scene names; `folder` contains its files."""

    folder: Path

    def mesh(self, name: str, unit_m: float) -> FileMesh:
        """Read a file whose unit is `unit_m`, again only if it has changed; see `read_mesh`."""
        return _read_version(file_version(self.folder, name), unit_m)


@lru_cache(maxsize=4)
def _read_version(file: FileVersion, unit_m: float) -> FileMesh:
    return FileMesh(file.path, read_mesh(read_version(file, "mesh"), unit_m))


def check_mesh(content: FileContent) -> None:
    """Check that an STL, OBJ or PLY file holds a closed mesh. Raises SceneFileError."""
    with unusable_file():
        read_mesh(content, None)


def read_mesh(content: FileContent, unit_m: float | None) -> trimesh.Trimesh:
    """Read the closed mesh [m] in an STL, OBJ or PLY file whose unit is `unit_m`, wound outward.

    Without a unit the mesh is made 1 m large. Vertices that agree to 1e-8 of the mesh's size are
    merged. Raises SceneFileError, which names the file, for anything but a single closed solid;
    InputError if its size in this unit is implausible.
    """
    path = content.path
    vertices, faces = _parsed(content)
    if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
        raise SceneFileError(
            f"{path}: has a vertex without three coordinates, or a face without three"
        )
    if len(faces) == 0:
        raise SceneFileError(f"{path}: has no faces, allowed is a closed mesh")
    if len(faces) > MAX_FACES:
        raise SceneFileError(f"{path}: has {len(faces)} faces, allowed are {MAX_FACES}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise SceneFileError(f"{path}: has faces with undefined vertices")
    if not np.isfinite(vertices).all():
        raise SceneFileError(f"{path}: has a vertex that is not finite, allowed are numbers")
    if unit_m is None:
        extent = float(np.ptp(vertices[faces], axis=(0, 1)).max())
        unit_m = 1 / extent if extent > 0 else 1.0
    mesh = trimesh.Trimesh(vertices * unit_m, faces, process=False)
    extent = float(max(mesh.extents))
    if not MIN_EXTENT <= extent <= MAX_EXTENT:
        raise InputError(  # not of the file alone: its unit may have been drawn
            f"{path}: is {extent:g} m large with its unit of {unit_m:g} m,"
            f" allowed are {MIN_EXTENT:g} to {MAX_EXTENT:g} m"
        )
    _merge(mesh, extent)
    if not mesh.is_watertight:
        raise SceneFileError(f"{path}: is not closed, allowed is a watertight mesh")
    if not mesh.is_winding_consistent:
        raise SceneFileError(f"{path}: is wound inconsistently, allowed is one orientation")
    volume = _volume(mesh)
    if abs(volume) <= 1e-12 * extent**3:
        raise SceneFileError(f"{path}: encloses no volume, allowed is a solid")
    if volume < 0:
        mesh.invert()
    return mesh


def _parsed(content: FileContent) -> tuple[Floats, np.ndarray]:
    """Read the vertices (n, 3) in the file's unit and triangles (m, 3) of all parts of a file."""
    path, kind = content.path, content.path.suffix.lower()
    if kind not in KINDS:
        raise SceneFileError(f"{path}: has the suffix {kind!r}, allowed are {', '.join(KINDS)}")
    try:
        # Loaded from memory and without materials, so that no other file named in it is opened.
        with np.errstate(all="ignore"):
            scene = trimesh.load_scene(
                io.BytesIO(content.data), file_type=kind[1:], process=False, skip_materials=True
            )
    except Exception as error:
        raise SceneFileError(f"{path}: is not a {kind} mesh that can be read") from error
    parts = [part for part in scene.geometry.values() if isinstance(part, trimesh.Trimesh)]
    mesh = together(parts) if parts else trimesh.Trimesh()
    if kind == ".stl" and not len(mesh.faces) and not content.data.isascii():
        # Where a package that guesses encodings is installed, trimesh takes it for a text.
        raise SceneFileError(f"{path}: is not a {kind} mesh that can be read")
    return np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces)


def _merge(mesh: trimesh.Trimesh, extent: float) -> None:
    """Merge vertices that agree to 1e-8 of the extent, and drop faces that this collapses."""
    mesh.merge_vertices(digits_vertex=8 - int(np.floor(np.log10(extent))))
    a, b, c = mesh.faces.T
    mesh.update_faces((a != b) & (b != c) & (c != a))


def _volume(mesh: trimesh.Trimesh) -> float:
    """Compute the volume [m^3], negative if wound inward; unlike in trimesh it may be zero."""
    a, b, c = np.moveaxis(mesh.triangles - mesh.vertices.mean(axis=0), 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)
