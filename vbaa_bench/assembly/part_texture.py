"""Textures of a part: an image, brushed lines or printed speckles."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.render.image_files import read_surface_image
from vbaa_bench.render.materials import Texture
from vbaa_bench.render.textures import image_texture, random_texture, speckle_texture
from vbaa_bench.scene.paint import (
    BrushedTextureSpec,
    ImageTextureSpec,
    PaintedPart,
    SpeckleTextureSpec,
)

# Reflectance of bare steel where its texture is brightest, over that of iron.
_BARE = 0.8


def part_texture(
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
