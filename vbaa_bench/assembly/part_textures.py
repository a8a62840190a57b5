"""Textures of the object, an image, brushed lines or printed speckles, and of the beam."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.assembly.mesh_file import SceneMeshes
from vbaa_bench.geometry.box_mapping import box_mapped
from vbaa_bench.render.image_files import read_surface_image
from vbaa_bench.render.materials import BLACK, Texture
from vbaa_bench.render.textures import (
    Grime,
    grime_texture,
    image_texture,
    random_texture,
    speckle_texture,
)
from vbaa_bench.scene.objects.object import ObjectSetting, TouchedKind
from vbaa_bench.scene.paint import (
    BrushedTextureSpec,
    ImageTextureSpec,
    PaintedPart,
    SpeckleTextureSpec,
)
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Reflectance of bare steel where its texture is brightest, over that of iron.
_BARE = 0.8


def object_texture(scene: Scene, rig: TrueRig, folder: Path, number: int = 0) -> Texture | None:
    """Create the texture of a scene's object, for its shape before it is touched.

    It is None if the object has none. `number` is that of the random pattern. Raises InputError.
    """
    spec = scene.object
    if not isinstance(spec, TouchedKind) or spec.texture is None:
        return None
    ground = -scene.background.distance_mm * MILLIMETRE
    setting = ObjectSetting(rig.beam.radius, ground, SceneMeshes(folder))
    places = box_mapped(spec.mesh(setting))
    random = random_generator(scene, "object texture", number)
    return _textured(spec, spec.texture, places, folder, random)


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


def _textured(
    part: PaintedPart,
    spec: ImageTextureSpec | BrushedTextureSpec | SpeckleTextureSpec,
    places: Floats,
    folder: Path,
    random: np.random.Generator,
) -> Texture:
    """Create the texture of a part at `places` (n, 2) [m]; an image file is in `folder`.

    On bare steel it changes the specular reflectance. Raises InputError.
    """
    mm, mean = MILLIMETRE, _BARE if part.paint == "bare" else part.reflectance
    extent = float(np.ptp(places, axis=0).max())
    match spec:
        case ImageTextureSpec():
            image = read_surface_image(folder, spec.file)
            texture = image_texture(places, image, mean, spec.width_mm * mm)
        case BrushedTextureSpec():
            turn = turn_about_z(-spec.direction_deg * DEGREE)[:2, :2]
            lengths = (spec.line_mm * spec.line_ratio * mm, spec.line_mm * mm)
            along = places @ turn.T
            texture = random_texture(along, mean, spec.contrast, lengths, 2 * extent, random)
        case SpeckleTextureSpec():
            cover = spec.cover_pct * PERCENT
            size, tones = spec.speckle_mm * mm, (mean, spec.speckle_reflectance)
            texture = speckle_texture(places, tones, size, cover, 2 * extent, random)
    return replace(texture, gloss=texture.image) if part.paint == "bare" else texture
