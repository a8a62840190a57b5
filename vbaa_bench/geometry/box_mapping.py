"""Coordinates for textures on bodies: every face is mapped along the axis that it faces most."""

import numpy as np
import trimesh

from solver.instrument.arrays import Floats


def unshared(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Give every face its own three vertices, so that faces can have different coordinates."""
    faces = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    return trimesh.Trimesh(np.asarray(mesh.vertices)[mesh.faces.ravel()], faces, process=False)


def box_mapped(mesh: trimesh.Trimesh) -> Floats:
    """Compute places (3 faces, 2) [m] of the vertices of `unshared(mesh)` on a flat sheet.

    A face that faces z most has x and y, one that faces y has x and z, one that faces x y and z.
    """
    corners = np.asarray(mesh.vertices)[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axes = np.array([[1, 2], [0, 2], [0, 1]])[np.abs(across).argmax(axis=1)]
    return np.asarray(np.take_along_axis(corners, axes[:, None, :], axis=2).reshape(-1, 2))
