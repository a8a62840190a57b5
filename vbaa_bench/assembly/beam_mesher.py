"""Meshes of the beam's surface, as fine as the camera resolves."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scipy.interpolate import CubicSpline

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.rings import facets, ring_count, rings
from vbaa_bench.geometry.tip import shaped, tip_rings
from vbaa_bench.geometry.tube import arc_length_of_vertices, around_of_vertices, strip, tube
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Scenes that allow stress above yield are meshed for this multiple of the curvature at yield.
_ABOVE_YIELD = 4.0


@dataclass(frozen=True)
class BeamMesher:
    """Mesher of one scene's beam; all meshes have the same topology."""

    scene: Scene
    rig: TrueRig

    def mesh(self, state: State) -> tuple[trimesh.Trimesh, Floats]:
        """Build the mesh in the clamp's frame [m], and the arc length [m] of its vertices."""
        spec, beam = self.scene.beam, self.rig.beam
        line, director = state.centreline, state.director
        s = rings(line[:, 0], line[:, 1:], self._rings)
        end = tip_rings(spec.tip, beam.radius * spec.tip_ratio * max(spec.aspect_ratio, 1.0))
        if spec.tip != "flat":
            # The number of rings must not depend on the beam's bend.
            s = np.append(s[:-1] * (1 - end.before_end[0] / s[-1]), s[-1] - end.before_end)
        points = CubicSpline(line[:, 0], line[:, 1:])(s)
        directors = None if director is None else CubicSpline(line[:, 0], director)(s)
        if spec.section == "strip":
            assert directors is not None
            width = spec.aspect_ratio * beam.diameter
            mesh = strip(points, directors, beam.diameter, width, caps_apart=True)
            return mesh, arc_length_of_vertices(s, 4)
        radius = beam.radius * (1 + (spec.tip_ratio - 1) * s / beam.length)
        if spec.tip != "flat":
            radius[-len(end.factor) :] *= end.factor
        mesh = tube(points, radius, self._facets, directors, spec.aspect_ratio, caps_apart=True)
        arc_length = arc_length_of_vertices(s, self._facets)
        if spec.tip != "flat":
            random = random_generator(self.scene, "tip")
            arc_length = shaped(mesh, arc_length, self._facets, spec.tip, random)
        return mesh, arc_length

    def around(self, arc_length: Floats) -> Floats:
        """Return the place around the beam of a mesh's vertices, for textures."""
        facets = 4 if self.scene.beam.section == "strip" else self._facets
        return around_of_vertices((len(arc_length) - 2) // facets - 2, facets)

    @cached_property
    def _facets(self) -> int:
        beam = self.scene.beam
        max_radius = self.rig.beam.radius * max(beam.aspect_ratio, 1.0) * max(beam.tip_ratio, 1.0)
        return facets(max_radius, self._tolerance)

    @cached_property
    def _rings(self) -> int:
        beam, spec = self.rig.beam, self.scene.beam
        min_radius = beam.radius * min(spec.tip_ratio, 1.0)
        curvature = spec.yield_stress_mpa * 1e6 / (spec.youngs_modulus_gpa * 1e9 * min_radius)
        if spec.allow_above_yield:
            curvature *= _ABOVE_YIELD
        return min(
            ring_count(beam.length, curvature, self._tolerance), spec.centreline_segments + 1
        )

    @property
    def _tolerance(self) -> float:
        """Mesh tolerance at the beam's middle [m], from the scene's tolerance in pixels."""
        middle = np.array([[self.rig.beam.length / 2, 0.0, 0.0]])
        pixel = 1 / float(self.rig.camera.pixels_per_metre(middle)[0])
        return self.scene.render.mesh_tolerance_px * pixel
