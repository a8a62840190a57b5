"""Meshes of the beam's surface, as fine as the camera resolves.

A bent tube differs from the smooth one by no more than a tolerance. The middle of a chord of length
h is kappa h^2 / 8 from its arc of curvature kappa; a regular polygon of n corners is up to
r (1 - cos(pi / n)) from its circle.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scipy.interpolate import CubicSpline

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.tip import TIPS, shaped
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
        s = _ring_places(line[:, 0], line[:, 1:], self._rings)
        tip = TIPS[spec.tip]
        end = tip.rings(beam.radius * spec.tip_ratio * max(spec.aspect_ratio, 1.0))
        has_rings = len(end.factor) > 0
        if has_rings:
            # The number of rings must not depend on the beam's bend.
            s = np.append(s[:-1] * (1 - end.before_end[0] / s[-1]), s[-1] - end.before_end)
        points = CubicSpline(line[:, 0], line[:, 1:])(s)
        directors = None if director is None else CubicSpline(line[:, 0], director)(s)
        if spec.section_shape.is_flat:
            assert directors is not None
            width = spec.aspect_ratio * beam.diameter
            mesh = strip(points, directors, beam.diameter, width, caps_apart=True)
            return mesh, arc_length_of_vertices(s, 4)
        radius = beam.radius * (1 + (spec.tip_ratio - 1) * s / beam.length)
        if has_rings:
            radius[-len(end.factor) :] *= end.factor
        mesh = tube(points, radius, self._facets, directors, spec.aspect_ratio, caps_apart=True)
        arc_length = arc_length_of_vertices(s, self._facets)
        if has_rings:
            random = random_generator(self.scene, "tip")
            arc_length = shaped(mesh, arc_length, self._facets, tip, random)
        return mesh, arc_length

    def around(self, arc_length: Floats) -> Floats:
        """Return the place around the beam of a mesh's vertices, for textures."""
        facets = 4 if self.scene.beam.section_shape.is_flat else self._facets
        return around_of_vertices((len(arc_length) - 2) // facets - 2, facets)

    @cached_property
    def _facets(self) -> int:
        beam = self.scene.beam
        max_radius = self.rig.beam.radius * max(beam.aspect_ratio, 1.0) * max(beam.tip_ratio, 1.0)
        return _facet_count(max_radius, self._tolerance)

    @cached_property
    def _rings(self) -> int:
        beam, spec = self.rig.beam, self.scene.beam
        min_radius = beam.radius * min(spec.tip_ratio, 1.0)
        curvature = spec.yield_stress_mpa * 1e6 / (spec.youngs_modulus_gpa * 1e9 * min_radius)
        if spec.allow_above_yield:
            curvature *= _ABOVE_YIELD
        return min(
            _ring_count(beam.length, curvature, self._tolerance), spec.centreline_segments + 1
        )

    @property
    def _tolerance(self) -> float:
        """Mesh tolerance at the beam's middle [m], from the scene's tolerance in pixels."""
        middle = np.array([[self.rig.beam.length / 2, 0.0, 0.0]])
        pixel = 1 / float(self.rig.camera.pixels_per_metre(middle)[0])
        return self.scene.render.mesh_tolerance_px * pixel


def _facet_count(radius: float, tolerance: float) -> int:
    """Compute the number of sides of a polygon within the tolerance of its circle.

    It is a multiple of four, so that the polygon is symmetric about both axes. Both lengths are
    in one unit.
    """
    return 4 * math.ceil(math.pi / math.acos(max(1 - tolerance / radius, 0.0)) / 4)


def _ring_count(length: float, sharpest: float, tolerance: float) -> int:
    """Compute the number of rings for chords of length sqrt(8 tolerance / kappa).

    It suffices for every beam of `length` whose curvature falls linearly from `sharpest` at the
    clamp to zero at the tip.
    """
    # The integral of sqrt(kappa) is two thirds of its value at the clamp.
    chords = 2 / 3 * length * math.sqrt(sharpest / (8 * tolerance))
    # Two in three rings are spaced by curvature, the others evenly.
    return max(math.ceil(1.5 * chords) + 1, 16)


def _ring_places(s: Floats, points: Floats, count: int) -> Floats:
    """Compute arc lengths (count,) of rings on a curve: points (n, 3) at arc lengths `s` (n,).

    The density of two in three is proportional to the square root of the curvature; the others
    are evenly spaced.
    """
    tangents = np.diff(points, axis=0) / np.diff(s)[:, None]
    angles = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
    spacing = (s[2:] - s[:-2]) / 2
    density = np.sqrt(angles / spacing)
    integral = np.concatenate(
        [[0.0], np.cumsum(np.interp((s[1:] + s[:-1]) / 2, s[1:-1], density) * np.diff(s))]
    )
    even = (s - s[0]) / (s[-1] - s[0])
    # On a straight beam all rings are evenly spaced.
    fraction = integral / integral[-1] if integral[-1] > 1e-9 else even
    return np.interp(np.linspace(0, 1, count), (2 * fraction + even) / 3, s)
