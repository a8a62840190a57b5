"""Direction of the light, along and across the beam.

A laboratory computes it from the positions of its lamps.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.rig import MAX_LIGHT_SLOPE
from vbaa_bench.scene.lights.sight import Sight, Tangent, bounded
from vbaa_bench.scene.schema import Scene

# Largest distance of the light, in lengths of the beam. Chosen: changes of direction along the beam
# are then a millionth.
_FAR: Final = 1e6
# Axes of plane C, from the clamp.
ALONG, ACROSS = 0, 1


class LightDirection(NamedTuple):
    """Direction of the light at the middle of the beam, and its distance.

    `slope` is the tangent, along the beam, between the directions to the light and to the camera,
    the mean over the lamps by their irradiance; `sigma` is its standard deviation. `distance_mm` is
    the distance across plane C of a small lamp whose direction changes as much along the beam.
    """

    slope: float
    sigma: float
    distance_mm: float


class _Lamp(NamedTuple):
    """Irradiance and direction of one light."""

    irradiance: float
    tangent: Tangent


def light_direction(scene: Scene) -> LightDirection:
    """Compute the light's direction along the beam from the places and sizes of the lamps."""
    sight = _sight(scene, ALONG)
    lamps = _lamps(scene, sight)
    power = sum(lamp.irradiance for lamp in lamps)
    slope = sum(lamp.irradiance * lamp.tangent.slope for lamp in lamps) / power
    gradient = sum(lamp.irradiance * lamp.tangent.gradient for lamp in lamps) / power
    variance = sum(
        lamp.irradiance * (lamp.tangent.sigma**2 + (lamp.tangent.slope - slope) ** 2)
        for lamp in lamps
    )
    farthest = _FAR * scene.beam.length_mm
    distance = 1 / max(sight.convergence - gradient, 1 / farthest)
    sigma = min(math.sqrt(variance / power), MAX_LIGHT_SLOPE)
    return LightDirection(bounded(slope), sigma, float(distance))


def light_across(scene: Scene) -> float:
    """Compute the root mean square tangent, across the beam, from the camera to the light."""
    lamps = _lamps(scene, _sight(scene, ACROSS))
    power = sum(lamp.irradiance for lamp in lamps)
    squares = sum(
        lamp.irradiance * (lamp.tangent.sigma**2 + lamp.tangent.slope**2) for lamp in lamps
    )
    return min(math.sqrt(squares / power), MAX_LIGHT_SLOPE)


def _sight(scene: Scene, axis: int) -> Sight:
    """Return the direction to the camera, seen from the beam's middle."""
    middle = np.array([scene.beam.length_mm / 2, 0.0, 0.0])
    camera = np.array(scene.camera.position_mm)
    is_pinhole = not scene.camera.is_telecentric
    view = camera - (middle if is_pinhole else scene.camera.look_at_mm)
    return Sight(middle, axis, view[axis] / view[2], 1 / camera[2] if is_pinhole else 0.0)


def _lamps(scene: Scene, sight: Sight) -> list[_Lamp]:
    """Compute irradiances and directions of all lights."""
    setting = scene.light_setting
    lamps = [_Lamp(lamp.irradiance, lamp.tangent(setting, sight)) for lamp in scene.lights]
    if not lamps:
        lamps = [_Lamp(1.0, scene.light.tangent(setting, sight))]
    if scene.ambient is not None:
        lamps.append(_Lamp(scene.ambient.irradiance, scene.ambient.tangent(sight)))
    return lamps
