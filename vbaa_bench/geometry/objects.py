"""What stands around the beam: the block it touches, the hub that holds it, the background."""

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z


def block(edge: Floats, heading: float, side: float, bottom: float, top: float) -> trimesh.Trimesh:
    """A square block whose upright edge stands at `edge` (2,) [m] in the x-y plane.

    Seen from above, the block's diagonal runs from the edge along `heading` [rad] from +x, away
    from the beam; it reaches from z = `bottom` to `top` [m].
    """
    mesh: trimesh.Trimesh = trimesh.creation.box(extents=(side, side, top - bottom))
    mesh.apply_translation((side / 2, side / 2, (top + bottom) / 2))
    placed = turn_about_z(heading - np.pi / 4)
    placed[:2, 3] = edge
    mesh.apply_transform(placed)
    return mesh


def hub(radius: float, bottom: float, top: float) -> trimesh.Trimesh:
    """The motor's hub: an upright cylinder about the z axis [m]."""
    mesh: trimesh.Trimesh = trimesh.creation.cylinder(
        radius=radius, height=top - bottom, sections=64
    )
    mesh.apply_translation((0.0, 0.0, (top + bottom) / 2))
    return mesh


def sheet(middle: Floats, side: float, facing: int) -> trimesh.Trimesh:
    """A square sheet across the z axis about `middle` (3,) [m], facing +z or -z (+1, -1)."""
    half = side / 2
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return trimesh.Trimesh(corners + middle, faces[:, ::facing], process=False)
