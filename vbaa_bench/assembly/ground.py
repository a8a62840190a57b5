"""The surfaces of the ground: a sheet, squares, or a table with an edge above a floor."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.assembly.ground_view import chequered_side, edge_side, edged_sheet
from vbaa_bench.geometry.board import squares
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.geometry.textures import Texture, gradient_texture, image_texture, random_texture
from vbaa_bench.render.image_files import read_surface_image
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.background import EdgeSpec
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

GROUND: Final = {"background", "background_squares", "table_side", "floor"}
# Side of a sheet so large that the camera never sees its border, over the beam's length.
_SIDE = 20


@dataclass(frozen=True)
class Ground:
    """The ground of a scene, in its own frame; `folder` contains the files that the scene names.

    `look` numbers the random patterns.
    """

    scene: Scene
    rig: TrueRig
    folder: Path
    look: int = 0

    @property
    def is_endless(self) -> bool:
        """Whether it is plain without an edge: it looks the same at every angle."""
        return self.scene.background.pattern == "plain" and self.scene.background.edge is None

    def surfaces(self) -> Iterator[tuple[str, Surface]]:
        """Yield its surfaces, made anew."""
        spec = self.scene.background
        if spec.edge is not None:
            yield from self._below(spec.edge)
        if spec.pattern != "squares":
            mesh = self._top(self._middle)
            yield "background", Surface(mesh, spec.reflectance, texture=self._texture)
            return
        turn = spec.square_turn_deg * DEGREE
        to_ground = turn_about_z(turn)
        axes = to_ground[:2, :2]
        # The pattern repeats after two squares along its own axes.
        offset = axes @ np.fmod(axes.T @ spec.square_offset_mm, 2 * spec.square_mm) * MILLIMETRE
        to_ground[:3, 3] = self._middle + np.append(offset, 0.0)
        side = chequered_side(self.scene, self.rig.camera) + 2 * float(np.abs(offset).max())
        turned_side = side * (abs(math.cos(turn)) + abs(math.sin(turn)))
        light, dark = squares(turned_side, spec.square_mm * MILLIMETRE)
        for name, mesh, reflectance in (
            ("background", light, spec.reflectance),
            ("background_squares", dark, spec.square_reflectance),
        ):
            mesh.apply_transform(to_ground)
            yield name, Surface(mesh, reflectance)

    def _below(self, edge: EdgeSpec) -> Iterator[tuple[str, Surface]]:
        """Yield the side of a table, and the floor."""
        azimuth, distance = edge.azimuth_deg * DEGREE, edge.distance_mm * MILLIMETRE
        thickness = min(edge.thickness_mm, edge.drop_mm) * MILLIMETRE
        side = edge_side(self._middle, self._side, azimuth, distance, thickness)
        yield "table_side", Surface(side, edge.side_reflectance)
        below = self._middle - [0.0, 0.0, edge.drop_mm * MILLIMETRE]
        yield "floor", Surface(sheet(below, self._side, 1), edge.floor_reflectance)

    def _top(self, middle: Floats) -> trimesh.Trimesh:
        """Mesh the sheet about `middle` (3,) [m], up to its edge if it has one."""
        edge = self.scene.background.edge
        if edge is None:
            return sheet(middle, self._side, 1)
        azimuth, distance = edge.azimuth_deg * DEGREE, edge.distance_mm * MILLIMETRE
        return edged_sheet(middle, self._side, azimuth, distance)

    @property
    def _middle(self) -> Floats:
        """The place (3,) below the beam's middle."""
        height = -self.scene.background.distance_mm * MILLIMETRE
        return np.array([self.rig.beam.length / 2, 0.0, height])

    @property
    def _side(self) -> float:
        return _SIDE * self.rig.beam.length

    @cached_property
    def _texture(self) -> Texture | None:
        """Texture of the sheet, centred on the beam's middle."""
        spec, length, mm = self.scene.background, self.rig.beam.length, MILLIMETRE
        corners = np.asarray(self._top(np.zeros(3)).vertices)[:, :2]
        match spec.pattern:
            case "graded":
                azimuth, extent = spec.gradient_deg * DEGREE, spec.gradient_mm * mm
                return gradient_texture(
                    corners, spec.reflectance, spec.far_reflectance, azimuth, extent
                )
            case "textured":
                grain = spec.correlation_mm * mm
                random = random_generator(self.scene, "ground", self.look)
                lengths = (grain * spec.correlation_ratio, grain)
                mean, contrast = spec.reflectance, spec.contrast
                return random_texture(corners, mean, contrast, lengths, 2 * length, random)
            case "image":
                assert spec.image_file is not None
                image = read_surface_image(self.folder, spec.image_file)
                return image_texture(corners, image, spec.reflectance, spec.image_width_mm * mm)
        return None
