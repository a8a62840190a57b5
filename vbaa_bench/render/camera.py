"""OpenCV's camera as Mitsuba's perspective sensor.

Mitsuba's camera looks along +z with x to the left and y up, OpenCV's with x to the right and
y down: half a turn about z apart. Mitsuba counts the image from the corner of its first pixel,
OpenCV from that pixel's centre: half a pixel apart. Mitsuba's principal point offset has the
opposite sign, in shares of the image's width and height.
"""

import math
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import invert

_OPENCV_FROM_MITSUBA = np.diag([-1.0, -1.0, 1.0, 1.0])


def sensor_dict(camera: Camera, render_from_antenna: Floats) -> dict[str, Any]:
    """Mitsuba's description of `camera`, whose box filter makes a pixel the mean over its area.

    `render_from_antenna` (4, 4) is a uniform scale and a shift. Needs square pixels.
    """
    if not math.isclose(camera.fx, camera.fy, rel_tol=1e-12):
        raise ValueError(f"fx {camera.fx} and fy {camera.fy} differ, allowed are square pixels")
    scale = float(np.cbrt(np.linalg.det(render_from_antenna[:3, :3])))
    antenna_from_camera = invert(camera.camera_from_antenna)
    pose = np.eye(4)
    pose[:3, :3] = (antenna_from_camera @ _OPENCV_FROM_MITSUBA)[:3, :3]
    pose[:3, 3] = (render_from_antenna @ antenna_from_camera[:, 3])[:3]
    farthest = 20 * float(np.linalg.norm(antenna_from_camera[:3, 3])) * scale
    return {
        "type": "perspective",
        "fov": math.degrees(2 * math.atan(camera.width / (2 * camera.fx))),
        "fov_axis": "x",
        "principal_point_offset_x": 0.5 - (camera.cx + 0.5) / camera.width,
        "principal_point_offset_y": 0.5 - (camera.cy + 0.5) / camera.height,
        "near_clip": 1e-4 * farthest,
        "far_clip": farthest,
        "to_world": pose,
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
