"""Meshes of the motor's hub and of the rod between it and the clamp, in metres."""

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import arc, prism, rod


def adaptor(offset: Floats, radius: float) -> Mesh:
    """Mesh the rod in Sigma_a from the motor's axis at -offset (3,) to the clamp at the origin."""
    return rod(-offset, np.zeros(3), radius)


def hub(radius: float, bottom: float, top: float) -> Mesh:
    """Mesh the motor's hub: an upright cylinder about the z axis [m]."""
    outline = arc(radius, 2 * np.pi * np.arange(64) / 64) + np.array([0.0, radius])
    return prism(outline, bottom, top)
