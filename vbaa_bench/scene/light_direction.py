"""Direction of the light, along and across the beam.

A laboratory knows it from where its lamps stand.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.rig import MAX_LIGHT_SLOPE
from solver.instrument.units import DEGREE
from vbaa_bench.scene.lighting import (
    AreaSpec,
    BackSpec,
    EnvironmentSpec,
    LampSpec,
    RingSpec,
    SideSpec,
)
from vbaa_bench.scene.schema import Scene

# Light from all around has windows and lamps anywhere. Chosen: a source at 27 degrees.
ENVIRONMENT_SIGMA: Final = 0.5
# Sigma of the tangent to a lamp. Chosen: its place is measured to 1 cm at a distance of 0.35 m.
PLACE_SIGMA: Final = 0.03
# Shift of a cylinder's shading in even light from the half-space above it, over that in light from
# one direction. Derived, as SHADING in the solver: brightness (1 + sqrt(1 - x^2)) / 2 + t x / 2.
EVEN: Final = (math.pi / 4) / (1 + math.pi / 4)
# Largest distance of the light, in lengths of the beam. Chosen: changes of direction along the beam
# are then a millionth.
_FAR: Final = 1e6
# Axes of plane C, from the clamp.
ALONG, ACROSS = 0, 1
# Height above plane C of lamps in or below it, whose light grazes. Chosen: ten times the least
# distance that rig.json states.
_LOWEST_MM: Final = 1e-5


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
    """Light of one lamp: irradiance, tangent relative to the camera's, its sigma and gradient.

    The gradient [1/mm] is the tangent's change along the beam.
    """

    irradiance: float
    slope: float
    sigma: float
    gradient: float


def light_direction(scene: Scene) -> LightDirection:
    """Compute the light's direction along the beam from the places and sizes of the lamps."""
    lamps, convergence = _lamps(scene, ALONG)
    power = sum(lamp.irradiance for lamp in lamps)
    slope = sum(lamp.irradiance * lamp.slope for lamp in lamps) / power
    gradient = sum(lamp.irradiance * lamp.gradient for lamp in lamps) / power
    variance = sum(lamp.irradiance * (lamp.sigma**2 + (lamp.slope - slope) ** 2) for lamp in lamps)
    farthest = _FAR * scene.beam.length_mm
    distance = 1 / max(convergence - gradient, 1 / farthest)
    sigma = min(math.sqrt(variance / power), MAX_LIGHT_SLOPE)
    return LightDirection(_bounded(slope), sigma, float(distance))


def light_across(scene: Scene) -> float:
    """Compute the root mean square tangent, across the beam, from the camera to the light."""
    lamps, _ = _lamps(scene, ACROSS)
    power = sum(lamp.irradiance for lamp in lamps)
    squares = sum(lamp.irradiance * (lamp.sigma**2 + lamp.slope**2) for lamp in lamps)
    return min(math.sqrt(squares / power), MAX_LIGHT_SLOPE)


def _lamps(scene: Scene, axis: int) -> tuple[list[_Lamp], float]:
    """Compute the light of all lamps along an axis.

    Also return the convergence [1/mm] of the rays to the camera.
    """
    camera = np.array(scene.camera.position_mm)
    is_pinhole = scene.camera.projection != "telecentric"
    view = camera - (_middle(scene) if is_pinhole else scene.camera.look_at_mm)
    to_camera = view[axis] / view[2]
    convergence = 1 / camera[2] if is_pinhole else 0.0
    lamps = [_lamp(scene, lamp, axis, to_camera, convergence) for lamp in scene.lights]
    if not lamps:
        soft_lamp, area = np.array([*camera[:2], scene.light.height_mm]), scene.light.side_mm**2
        lamps = [_panel(scene, soft_lamp, area, 1.0, axis, to_camera, convergence)]
    if scene.ambient is not None:  # its mean direction is straight down
        even = _Lamp(scene.ambient.irradiance, -EVEN * to_camera, PLACE_SIGMA, EVEN * convergence)
        lamps.append(even)
    return lamps, convergence


def _middle(scene: Scene) -> Floats:
    return np.array([scene.beam.length_mm / 2, 0.0, 0.0])


def _lamp(scene: Scene, lamp: LampSpec, axis: int, to_camera: float, convergence: float) -> _Lamp:
    if isinstance(lamp, RingSpec | BackSpec):
        # A ring is about the lens; before a panel the beam is a shadow, which has no shading.
        return _Lamp(lamp.irradiance, 0.0, 0.0, 0.0)
    if isinstance(lamp, EnvironmentSpec):
        return _Lamp(lamp.irradiance, 0.0, ENVIRONMENT_SIGMA, EVEN * convergence)
    area = math.prod(lamp.size_mm) if isinstance(lamp, AreaSpec | SideSpec) else 0.0
    if not isinstance(lamp, SideSpec):
        place = np.array(lamp.position_mm)
    else:
        azimuth, elevation = lamp.azimuth_deg * DEGREE, lamp.elevation_deg * DEGREE
        ahead = np.array([math.cos(azimuth), math.sin(azimuth), math.tan(elevation)])
        distance = lamp.distance_mm * math.cos(elevation)
        place = np.array(scene.camera.look_at_mm) + distance * ahead
    return _panel(scene, place, area, lamp.irradiance, axis, to_camera, convergence)


def _panel(
    scene: Scene,
    place: Floats,
    area: float,
    irradiance: float,
    axis: int,
    to_camera: float,
    convergence: float,
) -> _Lamp:
    """Compute the light of a lamp at (3,) [mm] with an area [mm^2] that faces the beam.

    The mean direction of the light from a wide lamp changes less than that to its middle: before a
    disc of radius R at distance d, as from a small lamp at d + R^2 / d (Lambert 1760).
    """
    middle = _middle(scene)
    wider = 1 + area / (math.pi * float((place - middle) @ (place - middle)))
    height = max(float(place[2]), _LOWEST_MM)
    slope = _bounded((place[axis] - middle[axis]) / height - to_camera)
    gradient = convergence - 1 / (height * wider)
    return _Lamp(irradiance, slope, PLACE_SIGMA, float(gradient))


def _bounded(slope: float) -> float:
    """Limit a slope to those that rig.json may state."""
    return float(np.clip(slope, -MAX_LIGHT_SLOPE, MAX_LIGHT_SLOPE))
