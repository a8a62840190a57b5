"""Where rays meet surfaces, in digits that are the same on every processor.

Embree, with which Mitsuba traces rays, chooses its instructions by the processor, and some of them
are approximations that each maker of processors defines for itself: the last digits of the places
that it finds differ. Its choice of the triangle is kept, and the place in it is computed anew, by
code that Dr.Jit compiles for the reference target.
"""

from typing import Any

import drjit as dr
import mitsuba as mi


def intersected(scene: Any, ray: Any, active: Any) -> Any:
    """Find the surface interaction that a ray meets first, as `scene.ray_intersect` does."""
    found = scene.ray_intersect_preliminary(ray, active=active)
    mesh = mi.MeshPtr(found.shape)  # null for shapes that are none
    is_mesh = active & (mesh != dr.zeros(mi.MeshPtr))
    place = mesh.ray_intersect_triangle(found.prim_index, ray, is_mesh)
    found.prim_uv = dr.select(is_mesh, place.prim_uv, found.prim_uv)
    # A ray that misses the triangle, by rounding, has no distance to it.
    found.t = dr.select(is_mesh & place.is_valid(), place.t, found.t)
    return found.compute_surface_interaction(ray, active=active)
