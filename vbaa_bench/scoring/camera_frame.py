"""Poses of the camera relative to the clamp."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE
from vbaa_bench.dataset.readers import Truth


def camera_frame_from_clamp(truth: Truth, motor_angle: float) -> Floats:
    """Make the transform (4, 4) from the clamp's frame to the frame in which the camera is fixed.

    `motor_angle` is in rad; the camera is the true one.
    """
    return np.asarray(camera_frames_from_clamp(truth, np.array([motor_angle]))[0])


def camera_frames_from_clamp(truth: Truth, motor_angles: Floats) -> Floats:
    """Make the transforms (n, 4, 4) of `camera_frame_from_clamp` for motor angles (n,) [rad]."""
    scene = truth.manifest["scene"]
    base = np.array(truth.manifest["true_rig"]["base_position_mm"]) * MILLIMETRE
    transforms = np.tile(np.eye(4), (len(motor_angles), 1, 1))
    if scene["camera"]["mount"] == "world":  # eq. (4): the motor turns the clamp about its axis
        axis = -np.array(scene["clamp_offset_mm"]) * MILLIMETRE
        cos, sin = np.cos(motor_angles), np.sin(motor_angles)
        transforms[:, 0, 0], transforms[:, 0, 1] = cos, -sin
        transforms[:, 1, 0], transforms[:, 1, 1] = sin, cos
        transforms[:, :3, 3] = axis - transforms[:, :3, :3] @ axis
    transforms[:, :3, 3] += base
    return transforms
