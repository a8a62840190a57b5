"""The poses in which the calibration board is held."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import rigid
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.schema import Scene


def board_tilt(scene: Scene, view: int) -> Floats:
    """Draw a view's board pose relative to view 0: tilted about its own x and y axes."""
    if view == 0:
        return np.eye(4)
    random = random_generator(scene, "board view", view)
    max_tilt = scene.calibration.tilt_deg * DEGREE
    # Tilt directions are spread evenly, and no tilt is near zero, as in careful calibration.
    fraction = (view + random.uniform(-0.2, 0.2)) / (scene.calibration.views - 1)
    azimuth = 2 * np.pi * fraction
    angle = max_tilt * random.uniform(0.7, 1.0)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    # Tilting brings one side nearer to the camera; lower the card so that it stays in view.
    lowering = random.uniform(0.12, 0.2) * scene.camera.position_mm[2] * MILLIMETRE
    return rigid(angle * axis, np.array([0.0, 0.0, -lowering]))
