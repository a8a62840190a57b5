"""Conversion of OpenCV's camera to Mitsuba's perspective or orthographic sensor.

Mitsuba's camera looks along +z with x to the left and y up, OpenCV's with x to the right and
y down: they differ by half a turn about z. Mitsuba's image origin is the corner of the first pixel,
OpenCV's is that pixel's centre: they differ by half a pixel. The perspective sensor's principal
point offset has the opposite sign, as fractions of the image's width and height. The orthographic
sensor has none, so it is shifted to the middle of the image.
"""

import math
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import invert

_OPENCV_FROM_MITSUBA = np.diag([-1.0, -1.0, 1.0, 1.0])


def sensor_dict(camera: Camera, render_from_antenna: Floats) -> dict[str, Any]:
    """Return Mitsuba's description of `camera`; its box filter averages over the area of a pixel.

    `render_from_antenna` (4, 4) is a uniform scale and a shift. Raises ValueError unless pixels
    are square.
    """
    if not math.isclose(camera.fx, camera.fy, rel_tol=1e-12):
        raise ValueError(f"fx {camera.fx} and fy {camera.fy} differ, allowed are square pixels")
    scale = float(np.cbrt(np.linalg.det(render_from_antenna[:3, :3])))
    antenna_from_camera = invert(camera.camera_from_antenna)
    pose = np.eye(4)
    pose[:3, :3] = (antenna_from_camera @ _OPENCV_FROM_MITSUBA)[:3, :3]
    pose[:3, 3] = (render_from_antenna @ antenna_from_camera[:, 3])[:3]
    far_clip = 20 * float(np.linalg.norm(antenna_from_camera[:3, 3])) * scale
    telecentric = camera.telecentric
    return {
        **(_orthographic(camera, pose, scale) if telecentric else _perspective(camera, pose)),
        "near_clip": 1e-4 * far_clip,
        "far_clip": far_clip,
        "sampler": {"type": "multijitter"},
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "pixel_format": "luminance",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
    }


def _perspective(camera: Camera, pose: Floats) -> dict[str, Any]:
    return {
        "type": "perspective",
        "fov": math.degrees(2 * math.atan(camera.width / (2 * camera.fx))),
        "fov_axis": "x",
        "principal_point_offset_x": 0.5 - (camera.cx + 0.5) / camera.width,
        "principal_point_offset_y": 0.5 - (camera.cy + 0.5) / camera.height,
        "to_world": pose,
    }


def _orthographic(camera: Camera, pose: Floats, scale: float) -> dict[str, Any]:
    """Return Mitsuba's orthographic sensor, whose rays start in the camera's plane.

    The lamp therefore stays behind it. In float32 no accuracy is lost: from a distance of 5,000
    units rays meet an edge to 0.001 units, from 50,000 to 0.003, from 500,000 to 0.01.
    """
    unit_per_pixel = scale / camera.fx
    # Mitsuba's axes are opposite to the image's.
    left = camera.cx - (camera.width - 1) / 2
    up = camera.cy - (camera.height - 1) / 2
    to_world = pose.copy()
    to_world[:3, 3] += pose[:3, :2] @ [left * unit_per_pixel, up * unit_per_pixel]
    # The sensor spans -1..1 across the image; its pixels are square.
    to_world[:3, :2] *= camera.width / 2 * unit_per_pixel
    return {"type": "orthographic", "to_world": to_world}
