"""Textures of the object and of the beam."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.assembly.mesh_file import SceneMeshes
from vbaa_bench.geometry.box_mapping import box_mapped
from vbaa_bench.geometry.textures import Grime, Texture, grime_texture
from vbaa_bench.render.image_files import SceneImages
from vbaa_bench.render.materials import BLACK
from vbaa_bench.scene.objects.object import ObjectSetting, TouchedKind
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scene.textures.texture import TextureSetting

# Reflectance of bare steel where its texture is brightest, over that of iron.
_BARE = 0.8


def object_texture(scene: Scene, rig: TrueRig, folder: Path, number: int = 0) -> Texture | None:
    """Create the texture of a scene's object, for its shape before it is touched.

    It is None if the object has none. `number` is that of the random pattern. On bare steel it
    changes the specular reflectance. Raises InputError.
    """
    spec = scene.object
    if not isinstance(spec, TouchedKind) or spec.texture is None:
        return None
    ground = -scene.background.distance_mm * MILLIMETRE
    object_setting = ObjectSetting(rig.beam.radius, ground, SceneMeshes(folder))
    places = box_mapped(spec.mesh(object_setting))
    extent = float(np.ptp(places, axis=0).max())
    random = random_generator(scene, "object texture", number)
    mean = _BARE if spec.paint == "bare" else spec.reflectance
    setting = TextureSetting(places, mean, extent, SceneImages(folder), random)
    texture = spec.texture.texture(setting)
    return replace(texture, gloss=texture.image) if spec.paint == "bare" else texture


def beam_texture(scene: Scene, rig: TrueRig, number: int = 0) -> Texture | None:
    """Create the texture of a scene's beam; None if it is clean.

    `number` is that of the random pattern.
    """
    spec, beam, mm = scene.beam.grime, rig.beam, MILLIMETRE
    if spec is None:
        return None
    grime = Grime(
        smudge_contrast=spec.smudge_contrast,
        smudge=spec.smudge_mm * mm,
        dust_cover=spec.dust_pct * PERCENT,
        dust=spec.dust_mm * mm,
        dust_reflectance=spec.dust_reflectance,
        uneven_gloss=spec.uneven_gloss,
    )
    reflectance = BLACK if scene.beam.paint == "black" else scene.beam.reflectance
    girth, random = 2 * np.pi * beam.radius, random_generator(scene, "grime", number)
    return grime_texture(grime, reflectance, beam.length, girth, random)
