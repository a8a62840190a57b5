"""The ground of a scene: its surfaces, and what the camera sees of it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.textures import Texture
from vbaa_bench.render.image_files import SceneImages
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.background import GroundSetting
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Margin beyond the camera's view, for the lens's blur.
_MARGIN: Final = 1.05
# Largest extent to either side of the beam's middle, over its length: a camera that looks across
# the ground sees it to the horizon.
_MAX_EXTENT: Final = 3.0


@dataclass(frozen=True)
class Ground:
    """The ground of a scene, in its own frame; `folder` contains the files that the scene names.

    `pattern_id` is the number of its random pattern.
    """

    scene: Scene
    rig: TrueRig
    folder: Path
    pattern_id: int = 0

    def surfaces(self) -> Iterator[tuple[str, Surface]]:
        """Yield its surfaces, made anew."""
        spec = self.scene.background
        for name, mesh, reflectance in spec.below_edge(self._setting):
            yield name, Surface(mesh, reflectance)
        for name, mesh, reflectance in spec.kind.top(self._setting):
            yield name, Surface(mesh, reflectance, texture=self._texture)

    @cached_property
    def _setting(self) -> GroundSetting:
        return ground_setting(self.scene, self.rig)

    @cached_property
    def _texture(self) -> Texture | None:
        random = random_generator(self.scene, "ground", self.pattern_id)
        files = SceneImages(self.folder)
        return self.scene.background.kind.texture(self._setting, files, random)


def ground_setting(scene: Scene, rig: TrueRig) -> GroundSetting:
    """Compute what the ground's shape refers to."""
    middle = np.array([[scene.beam.length_mm * MILLIMETRE / 2, 0.0, scene.background.height]])
    pixel = 1 / float(rig.camera.pixels_per_metre(middle)[0])
    return GroundSetting(rig.beam.length, _side_in_view(scene, rig.camera), pixel)


def _side_in_view(scene: Scene, camera: Camera) -> float:
    """Compute the side [m] of a square about the beam's middle that fills the image.

    It fills the image at every motor angle.
    """
    length = scene.beam.length_mm * MILLIMETRE
    middle = np.array([length / 2, 0.0])
    footprint, half = _footprint(camera, scene.background.height), math.inf
    if footprint is not None and scene.ground_turns:
        axis = motor_axis(scene)
        radius = np.linalg.norm(footprint - axis, axis=1).max()
        half = float(radius + np.linalg.norm(middle - axis))
    elif footprint is not None:
        half = float(np.abs(footprint - middle).max())
    return 2 * min(_MARGIN * half, _MAX_EXTENT * length)


def view_of_ground(scene: Scene, camera: Camera) -> tuple[Floats, Floats]:
    """Compute the corners (2,), (2,) [m] of a rectangle of the ground that contains the view.

    It is a square about the motor's axis if the ground turns against the camera, and limited where
    the camera sees the horizon.
    """
    footprint = _footprint(camera, scene.background.height)
    if footprint is None:
        length = scene.beam.length_mm * MILLIMETRE
        middle = np.array([length / 2, 0.0])
        return middle - _MAX_EXTENT * length, middle + _MAX_EXTENT * length
    if scene.ground_turns:
        axis = motor_axis(scene)
        radius = float(np.linalg.norm(footprint - axis, axis=1).max())
        return axis - radius, axis + radius
    return footprint.min(axis=0), footprint.max(axis=0)


def motor_axis(scene: Scene) -> Floats:
    """Return the place (2,) [m] of the motor's axis."""
    return -np.array(scene.clamp_offset_mm[:2]) * MILLIMETRE


def _footprint(camera: Camera, height: float) -> Floats | None:
    """Project the image's rim to points (n, 2) [m] of the plane z = `height`.

    Returns None where a part of the rim does not show the plane.
    """
    across, down = (
        np.linspace(-0.5, camera.width - 0.5, 17),
        np.linspace(-0.5, camera.height - 0.5, 17),
    )
    rim = [(u, v) for u in across for v in down[[0, -1]]]
    rim += [(u, v) for u in across[[0, -1]] for v in down]
    x, y = camera.normalised(np.array(rim)).T
    zeros, ones = np.zeros_like(x), np.ones_like(x)
    antenna_from_camera = invert(camera.camera_from_antenna)
    start = np.column_stack([x, y, zeros] if camera.telecentric else [zeros] * 3)
    direction = np.column_stack([zeros, zeros, ones] if camera.telecentric else [x, y, ones])
    start, direction = apply(antenna_from_camera, start), direction @ antenna_from_camera[:3, :3].T
    if (direction[:, 2] >= 0).any():
        return None
    fraction = (height - start[:, 2]) / direction[:, 2]
    return np.asarray((start + fraction[:, None] * direction)[:, :2])
