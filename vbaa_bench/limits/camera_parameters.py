"""Parameters of a camera: intrinsics, distortion, and its pose."""

from dataclasses import replace
from typing import Final

import numpy as np

from solver.instrument.camera import Camera
from solver.instrument.transforms import rigid

# Intrinsics [px], and turn [rad] and move [m] of the camera's own axes.
INTRINSICS: Final = ("fx", "fy", "cx", "cy")
POSE: Final = ("turn_x", "turn_y", "turn_z", "move_x", "move_y", "move_z")
_DISTORTION: Final = "distortion_"


def camera_parameters(camera: Camera) -> tuple[str, ...]:
    """List the parameters of a camera; distortion only if it has one."""
    distortion = (f"{_DISTORTION}{i}" for i in range(len(camera.distortion)))
    return (*INTRINSICS, *distortion, *POSE)


def changed_camera(camera: Camera, name: str, change: float) -> Camera:
    """Return a camera with one parameter changed."""
    if name in INTRINSICS:
        return replace(camera, **{name: getattr(camera, name) + change})
    if name.startswith(_DISTORTION):
        coefficients = list(camera.distortion)
        coefficients[int(name.removeprefix(_DISTORTION))] += change
        return replace(camera, distortion=tuple(coefficients))
    pose = small_motion(name, change) @ camera.camera_from_antenna
    return replace(camera, camera_from_antenna=pose)


def camera_unit(camera: Camera, name: str) -> float:
    """Return the natural unit of a parameter; 1 for those without: [rad], [m] and coefficients."""
    values = {
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": float(camera.width),
        "cy": float(camera.height),
    }
    return values.get(name, 1.0)


def small_motion(name: str, change: float) -> np.ndarray:
    """Return the transform (4, 4) of one parameter of a pose, such as `turn_x` or `move_z`."""
    turn, move = np.zeros(3), np.zeros(3)
    (turn if name.startswith("turn") else move)["xyz".index(name[-1])] = change
    return rigid(turn, move)
