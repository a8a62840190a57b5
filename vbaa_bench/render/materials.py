"""Paints as Mitsuba's BSDFs."""

from typing import Any

import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.textures import Texture
from vbaa_bench.scene.paint import Paint

# Refractive index and extinction coefficient of iron at 550 nm (Johnson and Christy 1974): its
# specular reflectance is 52 %.
IRON = (2.95, 2.93)
# Reflectance of matt black paint.
BLACK = 0.03


def bsdf(
    paint: Paint, reflectance: float, roughness: float, texture: Texture | None = None
) -> dict[str, Any]:
    """Return Mitsuba's description of a paint: matt, gloss (painted steel), bare steel or black.

    `reflectance` is the diffuse reflectance of matt and gloss paint, unless there is a `texture`;
    `roughness` is the alpha of the rough surface of gloss and bare.
    """
    if paint == "bare":
        # The Beckmann distribution has less self-shadowing than others: none up to alpha 0.4.
        steel = {"type": "roughconductor", "distribution": "beckmann", "alpha": roughness}
        eta, k = ({"type": "spectrum", "value": value} for value in IRON)
        return {"type": "twosided", "bsdf": {**steel, "eta": eta, "k": k, **_gloss(texture)}}
    colour: dict[str, Any] = {"type": "rgb", "value": BLACK if paint == "black" else reflectance}
    if texture is not None:
        colour = _bitmap(texture, texture.image)
    if paint == "gloss":
        plastic = {"type": "roughplastic", "diffuse_reflectance": colour, "alpha": roughness}
        return {**plastic, **_gloss(texture)}
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": colour}}


def _gloss(texture: Texture | None) -> dict[str, Any]:
    """Return the specular reflectance of a texture that has one."""
    if texture is None or texture.gloss is None:
        return {}
    return {"specular_reflectance": _bitmap(texture, texture.gloss)}


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
