"""Paints as Mitsuba's BSDFs."""

from typing import Any

import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.textures import Texture
from vbaa_bench.scene.paint import FINISHES, Paint


def bsdf(
    paint: Paint, reflectance: float, roughness: float, texture: Texture | None = None
) -> dict[str, Any]:
    """Return Mitsuba's description of a paint.

    `reflectance` is the diffuse reflectance of matt and gloss paint, unless there is a `texture`;
    `roughness` is the alpha of the rough surface of gloss and bare.
    """
    finish = FINISHES[paint]()
    diffuse: dict[str, Any] = {"type": "rgb", "value": finish.mean(reflectance)}
    specular = None
    if texture is not None:
        diffuse = _bitmap(texture, texture.image)
        specular = None if texture.gloss is None else _bitmap(texture, texture.gloss)
    return finish.description(diffuse, specular, roughness)


def _bitmap(texture: Texture, values: Floats) -> dict[str, Any]:
    image = np.ascontiguousarray(values[:, :, None], dtype=np.float32)
    bitmap = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(image),
        "raw": True,
        "wrap_mode": "repeat" if texture.repeated else "clamp",
        # Exact interpolation: that of GPU hardware has eight bits.
        "accel": False,
    }
    if texture.per_mm != 1:
        bitmap["to_uv"] = mi.ScalarTransform3f().scale([texture.per_mm, 1.0])
    return bitmap
