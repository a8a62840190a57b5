"""One photograph of a drawn rig: its scene, the bent beam, its surfaces and its image."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from results.photographs.develop import colour_jpeg, developed
from results.photographs.draw import GRAVITY_M_S2, PhotoDraw, RigDraw
from results.photographs.materials import Colour
from results.photographs.render import photographed
from results.pictures.outside_render import ColouredBody
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply
from solver.instrument.units import GRAM, MILLIMETRE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.geometry.textures import Texture, gaussian_field
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import check_scene
from vbaa_bench.scene.random_streams import random_generator, render_seed
from vbaa_bench.scene.rigs import true_rig
from vbaa_bench.scene.schema import Scene

# Passes of four samples per pixel. Chosen: with the lens's blur and JPEG the noise is that of a
# photograph in a room.
PASSES: Final = 4
_BLUR_PX: Final = 0.6
_STEEL: Final[Colour] = (0.35, 0.36, 0.38)
_DARK: Final[Colour] = (0.05, 0.05, 0.055)
_THINGS: Final = np.array([(0.6, 0.1, 0.08), (0.1, 0.4, 0.2), (0.75, 0.55, 0.1), (0.2, 0.2, 0.6)])
# Length of wood's grain along the beam and across it [m], and texels along it and around it.
_GRAIN, _TEXELS = (0.03, 0.5e-3), (2048, 64)


@dataclass(frozen=True)
class Shot:
    """One photograph of a rig before it is rendered. The camera is fixed in Sigma_a."""

    rig: RigDraw
    photo: PhotoDraw

    @cached_property
    def scene(self) -> Scene:
        """The scene of the photograph. Raises InputError if it is impossible."""
        load, tilt = self.photo.load, self.photo.tilt_deg
        length = self.rig.truth["length_mm"]
        keys: dict[str, Any] = {
            **self.rig.scene,
            "camera": self.photo.camera,
            "object": {"kind": "none"},
            "pushes": {
                "contact_distance_mm": [length / 2 if load is None else load.at_mm],
                "pushing_angle_deg": [0.0],
                "motor_angle_at_contact_deg": [tilt, tilt],
            },
        }
        if load is not None:
            keys["object"] = {
                "kind": "weight",
                "weight_g": load.force_n / GRAVITY_M_S2 / GRAM,
                "thread_diameter_mm": 0.0025 * length,
                "thread_length_mm": 0.1 * length,
                "weight_diameter_mm": 0.07 * length,
                "weight_height_mm": 0.09 * length,
                "reflectance": 0.4,
                "paint": "gloss",
            }
        return check_scene(keys).scene

    @cached_property
    def pose(self) -> Pose:
        """The beam in equilibrium. Raises EquilibriumError."""
        spec = Frames(self.scene).of_push(0)[0]
        experiment = Experiment(self.scene, true_rig(self.scene), spec.push, Path())
        return Pose(experiment, spec, experiment.states()[0])

    @property
    def camera(self) -> Camera:
        """The true camera."""
        return self.pose.experiment.rig.camera

    @cached_property
    def centreline_px(self) -> Floats:
        """Image (n, 2) of the centreline from clamp to tip."""
        # Every tenth of the 401 rows is enough for a check of the image.
        line = self.pose.state.centreline[::10, 1:]
        return self.camera.project(apply(self.pose.camera_frame_from_clamp, line))


def rendered(shot: Shot, number: int, passes: int = PASSES) -> bytes:
    """Render, develop and compress photograph `number` of a rig, as a JPEG file."""
    scene, pose = shot.scene, shot.pose
    assembler = SceneAssembler(scene, pose.experiment.rig, Path())
    grain = _grain(shot.rig, scene)
    bodies = {
        name: _coloured(name, surface, shot.rig.colours, grain)
        for name, surface in assembler.surfaces(pose).items()
    }
    random = random_generator(scene, "photograph", number)
    seed = render_seed(scene, "photograph", number) >> 8  # passes have consecutive ones
    lamps = lights(scene, Path())
    radiance = photographed(bodies, lamps, shot.camera, assembler.unit, passes, seed)
    return colour_jpeg(developed(radiance, _BLUR_PX, random), shot.photo.quality)


def _grain(rig: RigDraw, scene: Scene) -> Texture:
    """Make the grain of a beam, the same in all photographs: fine around it, long along it."""
    length = scene.beam.length_mm * MILLIMETRE
    girth = np.pi * scene.beam.diameter_mm * MILLIMETRE
    columns, rows = _TEXELS
    texels = np.array([length / columns, girth / rows])
    field = gaussian_field((rows, columns), texels, _GRAIN, random_generator(scene, "grain"))
    image = np.exp(rig.grain * field - rig.grain**2 / 2)
    return Texture(image[: rows // 2], np.empty((0, 2)), per_mm=1e-3 / length)


def _coloured(
    name: str, surface: Surface, colours: Mapping[str, Colour], grain: Texture
) -> ColouredBody:
    if name == "beam":
        surface = replace(surface, texture=grain)
    if name.startswith("clutter") and surface.texture is not None:
        count = surface.texture.image.shape[1]
        return ColouredBody(surface, _STEEL, _THINGS[np.arange(count) % len(_THINGS)])
    # The hub's top is in the plane of the flange's: both have one colour.
    dark = name in ("cable", "flange", "hub")
    return ColouredBody(surface, colours.get(name, _DARK if dark else _STEEL))
