"""Radiance across the beam's image and beside it, from the scene's lights and paints.

Shadows, light between surfaces and textures are neglected: they change the contrast in places,
whereas the limit depends on the contrast along the whole beam.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.geometry.sheets import between
from vbaa_bench.limits.dirt import Dirt, dirt_of
from vbaa_bench.limits.profile import SurfaceProfile, gray_profile
from vbaa_bench.limits.section import Sections, visible_side
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.reflection import Reflection
from vbaa_bench.scene.lights.emitter import Emitter
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.schema import Scene
from vbaa_bench.sensor.from_spec import metered_peak
from vbaa_bench.sensor.vignetting import relative_illumination

# Offsets across the beam at which the radiance is computed. Measured: twice as many change the
# information on a shift by less than 1 %.
_OFFSETS: Final = 16
# Pixels along each side of the image in which the background is evaluated for the exposure.
_GRID: Final = 12


@dataclass(frozen=True)
class LitBeam:
    """The beam of a scene in its light."""

    assembler: SceneAssembler

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.assembler.scene

    def surfaces(self, rod: Rod, camera: Camera, sections: Sections) -> list[SurfaceProfile]:
        """Compute the radiance across the beam's image at n sections, and beside it."""
        towards = camera.directions_from(sections.points)
        # Across the tangent and the ray; then nearest to the camera.
        across = np.cross(sections.tangents, towards)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        nearest = np.cross(across, sections.tangents)
        sides = [
            visible_side(rod, s, axes, a, c, _OFFSETS)
            for s, axes, a, c in zip(sections.s, sections.axes, across, nearest, strict=True)
        ]
        half = np.array([side.half_width for side in sides])[:, None]
        ends = [camera.project(sections.points + sign * half * across) for sign in (-1, 1)]
        normal = (ends[1] - ends[0]) / 2
        half_px = np.linalg.norm(normal, axis=1)
        pixels = (ends[0] + ends[1]) / 2
        arriving = self._light_of(camera, pixels)[:, None]
        normals = np.concatenate([side.normals for side in sides])
        points, to_camera = (np.repeat(x, _OFFSETS, axis=0) for x in (sections.points, towards))
        paint = self.scene.beam
        lit = self._reflection.radiance(paint, points, normals, to_camera)
        diffuse = lit
        if self.dirt is not None:
            specular = np.zeros_like(lit)
            if paint.finish.shines:
                shine = paint.model_copy(update={"reflectance": 0.0})
                specular = self._reflection.radiance(shine, points, normals, to_camera)
            diffuse = self.dirt.mean_diffuse * (lit - specular)
            lit = diffuse + self.dirt.mean_specular * specular
        lit, diffuse = (arriving * part.reshape(len(sides), _OFFSETS) for part in (lit, diffuse))
        behind = arriving[:, 0] * self.background(camera, sections.points)
        spread = self._spread(camera, sections.points)
        return [
            SurfaceProfile(
                lit[i], float(behind[i]), width, normal[i] / width, float(spread[i]), diffuse[i]
            )
            for i, width in enumerate(map(float, half_px))
        ]

    def background(self, camera: Camera, points: Floats) -> Floats:
        """Compute the radiance (n,) of what the camera sees behind points (n, 3)."""
        spec = self.scene.background
        back = -camera.directions_from(points)
        ground = points + back * ((spec.height - points[:, 2:]) / back[:, 2:])
        sheet = PaintedPart(reflectance=spec.kind.mean_reflectance)
        up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        radiance = self._reflection.radiance(sheet, ground, up, -back)
        sheets = (light.sheet for light in self._lights)
        for lamp in (sheet for sheet in sheets if sheet is not None):
            seen = between(lamp.mesh, points, ground)
            faces = np.asarray(lamp.mesh.face_normals).mean(axis=0)
            radiance = np.where(seen & (back @ faces < 0), lamp.radiance, radiance)
        return radiance

    def peak_radiance(self, rod: Rod, camera: Camera, at_rest: Sections) -> float:
        """Compute the radiance by which the exposure is metered, with the beam at rest."""
        levels = []
        for surface in self.surfaces(rod, camera, at_rest):
            profile = gray_profile(surface)
            levels.append(profile.mean[profile.cover >= 0.5 * profile.cover.max()])
        u, v = np.meshgrid(
            *(
                (np.arange(_GRID) + 0.5) / _GRID * side - 0.5
                for side in (camera.width, camera.height)
            )
        )
        pixels = np.column_stack([u.ravel(), v.ravel()])
        grid = self.background(camera, camera.on_plane(pixels)) * self._light_of(camera, pixels)
        return metered_peak(np.concatenate(levels), grid)

    def _light_of(self, camera: Camera, pixels: Floats) -> Floats:
        """Compute the fraction of the light that the lens transmits to pixels (n, 2)."""
        darker = self.scene.optics.vignetting_pct * PERCENT
        shape = camera.height, camera.width
        return relative_illumination(pixels[:, 0], pixels[:, 1], shape, darker)

    def _spread(self, camera: Camera, points: Floats) -> Floats:
        """Compute the sigma (n,) [px] of the point spread, with that of a blurred point's disc."""
        optics = self.scene.optics
        if optics.aperture_mm == 0:
            return np.full(len(points), optics.point_spread_px)
        aim = np.array(self.scene.camera.look_at_mm) * MILLIMETRE
        axis = camera.camera_from_antenna[2]
        depth = points @ axis[:3] + axis[3]
        focus = float(aim @ axis[:3] + axis[3])
        if optics.focus_distance_mm is not None:
            focus = optics.focus_distance_mm * MILLIMETRE
        radius = optics.aperture_mm * MILLIMETRE / 2 * np.abs(1 - focus / depth)
        radius *= camera.fx / (1 if camera.telecentric else focus)
        # The variance of a uniform disc along one axis is a quarter of its squared radius.
        return np.asarray(np.hypot(optics.point_spread_px, radius / 2))

    @cached_property
    def dirt(self) -> Dirt | None:
        """Dirt on the beam; None if it is clean."""
        return dirt_of(self.scene, self.assembler.rig, _OFFSETS)

    @cached_property
    def _lights(self) -> list[Emitter]:
        return lights(self.scene, self.assembler.folder)

    @cached_property
    def _reflection(self) -> Reflection:
        return Reflection(self._lights, self.assembler.unit.render_from_antenna)
