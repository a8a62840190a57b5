"""Direction of the light along the beam, as a laboratory knows it from where its lamps stand."""

import math
from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE
from vbaa_bench.scene.lighting import BackSpec, EnvironmentSpec, LampSpec, RingSpec, SideSpec
from vbaa_bench.scene.schema import Scene

# Light from all around has windows and lamps anywhere. Chosen: a source at 27 degrees.
ENVIRONMENT_SIGMA = 0.5
# Places along the beam at which directions are compared, over its length.
PLACES = np.array([0.0, 0.5, 1.0])


class LightSlope(NamedTuple):
    """Tangent, along the beam, between directions to the light and to the camera.

    `mean` is over the beam and over the lamps, by their irradiance; `sigma` is its spread.
    """

    mean: float
    sigma: float


def light_slope(scene: Scene) -> LightSlope:
    """Compute the light's slope from the places of the lamps."""
    lamps = [(lamp.irradiance, _slopes(scene, lamp)) for lamp in scene.lights]
    if not lamps:
        soft_lamp = np.array([*scene.camera.position_mm[:2], scene.light.height_mm])
        lamps = [(1.0, _slopes_to(scene, soft_lamp))]
    power = sum(irradiance for irradiance, _ in lamps)
    mean = sum(irradiance * slopes.mean() for irradiance, slopes in lamps) / power
    square = sum(irradiance * (slopes**2).mean() for irradiance, slopes in lamps) / power
    return LightSlope(float(mean), math.sqrt(max(square - mean**2, 0.0)))


def _slopes(scene: Scene, lamp: LampSpec) -> Floats:
    """Compute slopes of one lamp, whose mean and spread are its own."""
    if isinstance(lamp, RingSpec | BackSpec):
        # A ring is about the lens; before a panel the beam is a shadow, which has no shading.
        return np.zeros(1)
    if isinstance(lamp, EnvironmentSpec):
        return ENVIRONMENT_SIGMA * np.array([-1.0, 1.0])
    if not isinstance(lamp, SideSpec):
        return _slopes_to(scene, np.array(lamp.position_mm))
    azimuth, elevation = lamp.azimuth_deg * DEGREE, lamp.elevation_deg * DEGREE
    ahead = np.array([math.cos(azimuth), math.sin(azimuth), math.tan(elevation)])
    distance = lamp.distance_mm * math.cos(elevation)
    return _slopes_to(scene, np.array(scene.camera.look_at_mm) + distance * ahead)


def _slopes_to(scene: Scene, lamp: Floats) -> Floats:
    """Compute the slopes of a lamp at (3,) [mm] from places along the beam."""
    camera = np.array(scene.camera.position_mm)
    x = PLACES * scene.beam.length_mm
    to_camera = (camera[0] - x) / camera[2]
    if scene.camera.projection == "telecentric":
        axis = camera - scene.camera.look_at_mm
        to_camera = np.full_like(x, axis[0] / axis[2])
    return np.asarray((lamp[0] - x) / lamp[2] - to_camera)
