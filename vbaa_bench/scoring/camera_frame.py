"""Pose of the camera relative to the clamp."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.instrument.units import MILLIMETRE
from vbaa_bench.dataset.readers import Truth


def camera_frame_from_clamp(truth: Truth, motor_angle: float) -> Floats:
    """Make the transform (4, 4) from the clamp's frame to the frame in which the camera is fixed.

    `motor_angle` is in rad; the camera is the true one.
    """
    scene = truth.manifest["scene"]
    base = np.array(truth.manifest["true_rig"]["base_position_mm"]) * MILLIMETRE
    frame_from_clamp = np.eye(4)
    if scene["camera"]["mount"] == "world":
        axis = -np.array(scene["clamp_offset_mm"]) * MILLIMETRE
        frame_from_clamp = turn_about_z(motor_angle)
        frame_from_clamp[:3, 3] = axis - frame_from_clamp[:3, :3] @ axis
    frame_from_clamp[:3, 3] += base
    return frame_from_clamp
