"""Poses of the object against the beam."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import rigid


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
