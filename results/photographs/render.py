"""Radiance of a coloured scene in a photograph, through a lens with distortion."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import mitsuba as mi
import numpy as np

from results.pictures.outside_render import ColouredBody, coloured_world
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from vbaa_bench.render.camera import sensor_dict
from vbaa_bench.render.loading import load
from vbaa_bench.render.surface import RenderUnit
from vbaa_bench.scene.lights.emitter import Emitter

# Light goes from a lamp over one further surface to the camera.
_DEPTH = 3
# Samples per pixel of one pass. Chosen: with more, three megapixels need gigabytes.
_PASS = 4
# Pixels beside those that are looked up, for the interpolation.
_BORDER_PX = 8


def photographed(
    bodies: Mapping[str, ColouredBody],
    lights: Sequence[Emitter],
    camera: Camera,
    unit: RenderUnit,
    passes: int,
    seed: int,
) -> Floats:
    """Render the radiance (height, width, 3), red first, that a camera sees.

    Surfaces are those of the frame in which the camera is fixed. A lens with distortion is rendered
    without it, in a wider view, and interpolated. The variant must be one of colour.
    """
    ideal, pixels = _without_distortion(camera)
    sensor = sensor_dict(ideal, unit.render_from_antenna)
    sensor["to_world"] = mi.ScalarTransform4f(sensor["to_world"])
    sensor["film"] = {**sensor["film"], "pixel_format": "rgb"}
    scene = load(
        {
            **coloured_world(bodies, lights, unit),
            "sensor": sensor,
            "integrator": {"type": "path", "max_depth": _DEPTH, "hide_emitters": True},
        }
    )
    image = np.zeros((ideal.height, ideal.width, 3))
    for number in range(passes):
        seeded = mi.UInt32(passes * seed + number)
        image += np.asarray(mi.render(scene, spp=_PASS, seed=seeded))[..., :3] / passes
    if pixels is None:
        return image
    u, v = pixels.astype(np.float32)
    resampled = cv2.remap(image.astype(np.float32), u, v, cv2.INTER_CUBIC)
    return np.maximum(np.asarray(resampled, dtype=np.float64), 0.0)


def _without_distortion(camera: Camera) -> tuple[Camera, Floats | None]:
    """Return a pinhole camera that sees all of a camera's view, and where its pixels are there.

    The places (2, height, width) are None for a camera without distortion.
    """
    if not camera.distortion:
        return camera, None
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64)
    pixels = camera.undistorted_pixels(np.column_stack([u.ravel(), v.ravel()]))
    low = np.floor(pixels.min(axis=0)).astype(int) - _BORDER_PX
    high = np.ceil(pixels.max(axis=0)).astype(int) + _BORDER_PX
    width, height = (high - low + 1).tolist()
    ideal = replace(
        camera,
        width=width,
        height=height,
        cx=camera.cx - float(low[0]),
        cy=camera.cy - float(low[1]),
        distortion=(),
    )
    return ideal, (pixels - low).T.reshape(2, camera.height, camera.width)
