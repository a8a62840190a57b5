"""A colour picture of the whole rig, from outside: for readers, not for a dataset."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.lights import emitter
from vbaa_bench.render.loading import load
from vbaa_bench.render.materials import bsdf
from vbaa_bench.render.surface import RenderUnit, Surface, mitsuba_mesh
from vbaa_bench.scene.lights.emitter import Emitter

Colour = tuple[float, float, float]

# Radiance of the room, over the mean radiance of a matt sheet that reflects all light of one unit
# of irradiance: soft light from all sides. Chosen, as are all values of this module, by eye.
_ROOM: Colour = (0.60, 0.64, 0.70)
_BOUNCES = 6
# Level of the image's median. A brighter quantile would depend on how much of a lamp is in view.
_LEVEL = 0.40


# Rendered pixels per pixel of the picture, in each direction. Chosen by eye.
FINER = 3


class Viewpoint(NamedTuple):
    """Where the picture is taken from: both places (3,) [m] in Sigma_a, and its height [deg]."""

    position: Floats
    target: Floats
    fov_deg: float


@dataclass(frozen=True)
class ColouredBody:
    """A surface and its colour; with a texture, `colours` (texels, 3) or a tint of its grays."""

    surface: Surface
    colour: Colour
    colours: Floats | None = None


def picture(
    bodies: Mapping[str, ColouredBody],
    lights: Sequence[Emitter],
    viewpoint: Viewpoint,
    unit: RenderUnit,
    size: tuple[int, int],
    samples: int,
) -> np.ndarray:
    """Render a picture (height, width, 3) of 8 bits in sRGB, blue first.

    `size` is (width, height); each of the FINER**2 parts of a pixel has `samples`. The variant must
    be one of colour. Soft light of a room is added to the lights.
    """
    world = coloured_world(bodies, lights, unit)
    if all(light.extent() is not None for light in lights):
        room = {"type": "rgb", "value": [level / np.pi for level in _ROOM]}
        world["room"] = {"type": "constant", "radiance": room}
    world["sensor"] = _sensor(viewpoint, unit, (FINER * size[0], FINER * size[1]))
    world["integrator"] = {"type": "path", "max_depth": _BOUNCES, "hide_emitters": False}
    image = mi.render(load(world), spp=samples, seed=mi.UInt32(1))
    # Averaged after its tones are softened: edges of lamps are many times brighter than white.
    fine = _developed(np.asarray(image, dtype=np.float64)[..., :3])
    return cv2.resize(fine, size, interpolation=cv2.INTER_AREA)


def coloured_world(
    bodies: Mapping[str, ColouredBody], lights: Sequence[Emitter], unit: RenderUnit
) -> dict[str, Any]:
    """Return Mitsuba's description of coloured bodies and lights, without sensor and integrator."""
    matrix = unit.render_from_antenna
    return {
        "type": "scene",
        **{f"light_{number}": emitter(light, matrix) for number, light in enumerate(lights)},
        **{
            name: mitsuba_mesh(name, body.surface, unit, _paint(body))
            for name, body in bodies.items()
        },
    }


def _sensor(viewpoint: Viewpoint, unit: RenderUnit, size: tuple[int, int]) -> dict[str, Any]:
    position, target = unit(np.array([viewpoint.position, viewpoint.target]))
    return {
        "type": "perspective",
        "fov": viewpoint.fov_deg,
        "fov_axis": "y",
        "near_clip": 1.0,
        "far_clip": 1e5,
        "to_world": mi.ScalarTransform4f().look_at(
            origin=position.tolist(), target=target.tolist(), up=[0, 0, 1]
        ),
        "film": {
            "type": "hdrfilm",
            "width": size[0],
            "height": size[1],
            "pixel_format": "rgb",
            "rfilter": {"type": "gaussian"},
        },
    }


def _paint(body: ColouredBody) -> dict[str, Any]:
    """Return the paint of a surface, in colour."""
    surface = body.surface
    paint = bsdf(surface.paint, surface.reflectance, surface.roughness)
    if surface.paint == "bare":
        return paint
    inner = paint["bsdf"] if paint["type"] == "twosided" else paint
    key = "diffuse_reflectance" if surface.paint == "gloss" else "reflectance"
    inner[key] = {"type": "rgb", "value": list(body.colour)}
    texture = surface.texture
    if texture is not None:
        grays = texture.image[:, :, None]
        tinted = grays / grays.mean() * np.array(body.colour)
        image = tinted if body.colours is None else body.colours[None]
        inner[key] = {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(np.clip(image, 0, 1), dtype=np.float32)),
            "raw": True,
            "wrap_mode": "repeat" if texture.repeated else "clamp",
        }
        if texture.per_mm != 1:
            inner[key]["to_uv"] = mi.ScalarTransform3f().scale([texture.per_mm, 1.0])
    return paint


def _developed(radiance: Floats) -> np.ndarray:
    """Convert radiance (height, width, 3) to 8 bits in sRGB, with softened highlights."""
    light = radiance * _LEVEL / float(np.median(radiance.mean(axis=2)))
    # Straight up to the knee, then ever flatter, up to 1.
    knee = 0.6
    over = np.maximum(light - knee, 0) / (1 - knee)
    light = np.where(light > knee, knee + (1 - knee) * (1 - np.exp(-over)), light)
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * np.clip(encoded, 0, 1)).astype(np.uint8)[:, :, ::-1])
