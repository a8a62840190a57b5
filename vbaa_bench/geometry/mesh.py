"""Meshes whose vertices keep their order."""

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from solver.instrument.arrays import Floats

if TYPE_CHECKING:
    import trimesh

Mesh: TypeAlias = "trimesh.Trimesh"


def mesh_of(vertices: Floats, faces: np.ndarray | list[list[int]]) -> Mesh:
    """Make a mesh of vertices (n, 3) and faces (m, 3), as they are."""
    import trimesh  # takes a quarter of a second: scenes are read without it

    return trimesh.Trimesh(vertices, faces, process=False)
