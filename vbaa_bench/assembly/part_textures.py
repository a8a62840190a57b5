"""Textures of the object and of the beam, and the object before it is touched."""

from pathlib import Path

import numpy as np

from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.assembly.mesh_file import SceneMeshes
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.textures import Grime, Texture, box_mapped, grime_texture
from vbaa_bench.render.image_files import SceneImages
from vbaa_bench.scene.objects.object import ObjectSetting, TouchedKind
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scene.textures.texture import TextureSetting


def untouched_object(scene: Scene, rig: TrueRig, folder: Path) -> Mesh:
    """Build the mesh [m] of a scene's object before it is touched, in the object's frame."""
    setting = ObjectSetting(rig.beam.radius, scene.background.height, SceneMeshes(folder))
    return scene.object.mesh(setting)


def object_texture(scene: Scene, rig: TrueRig, folder: Path, pattern_id: int = 0) -> Texture | None:
    """Create the texture of a scene's object, for its shape before it is touched.

    It is None if the object has none. `pattern_id` is the number of the random pattern. Raises
    InputError.
    """
    spec = scene.object
    if not isinstance(spec, TouchedKind) or spec.texture is None:
        return None
    places = box_mapped(untouched_object(scene, rig, folder))
    extent = float(np.ptp(places, axis=0).max())
    random = random_generator(scene, "object texture", pattern_id)
    files = SceneImages(folder)
    setting = TextureSetting(places, spec.mean_reflectance, extent, files, random)
    return spec.finish.textured(spec.texture.texture(setting))


def beam_texture(scene: Scene, rig: TrueRig, pattern_id: int = 0) -> Texture | None:
    """Create the texture of a scene's beam; None if it is clean.

    `pattern_id` is the number of the random pattern.
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
    girth, random = 2 * np.pi * beam.radius, random_generator(scene, "grime", pattern_id)
    return grime_texture(grime, scene.beam.mean_reflectance, beam.length, girth, random)
