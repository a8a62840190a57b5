"""Light from all around: a generated laboratory, or an image.

A map (height, width) of radiances has its first row at +z and its last at -z, as in Mitsuba. Its
columns run from +x through +y around.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE
from vbaa_bench.scene.files import EnvironmentName, ImageFiles
from vbaa_bench.scene.lights.ambient import EVEN
from vbaa_bench.scene.lights.emitter import Emitter
from vbaa_bench.scene.lights.light import LightKind, LightSetting
from vbaa_bench.scene.lights.sight import Sight, Tangent
from vbaa_bench.scene.part import Turn

# Light from all around has windows and lamps anywhere. Chosen: a source at 27 degrees.
ENVIRONMENT_SIGMA: Final = 0.5
HEIGHT, WIDTH = 128, 256
# Samples along each side of a pixel: antialiases the edges of windows and lamps.
SUBPIXELS = 4
# Steps in polar angle of the integral over the upper hemisphere.
INTEGRATION_STEPS = 20_000
# Distances [m] from the rig to the room's east, north, west, south walls, ceiling, floor.
EAST, NORTH, WEST, SOUTH, CEILING, FLOOR = 3.5, 2.5, 3.0, 2.0, 2.0, 0.9
# Radiances relative to that of a white wall.
WALL, WHITE_CEILING, DARK_FLOOR, FURNITURE, TUBE, SKY, HORIZON = 1.0, 1.4, 0.3, 0.25, 60, 40, 15


@dataclass(frozen=True)
class Environment(Emitter):
    """Infinitely distant light from all directions: `image` (height, width) of radiances.

    The first row is at +z, straight up, the last straight down; columns run from +x through +y
    around.
    """

    image: Floats

    def extent(self) -> None:
        """Return None: it is infinitely far."""

    def with_ambient(self, radiance: float) -> "Environment":
        """Add the radiance to that from every direction."""
        return Environment(self.image + radiance)

    def description(self, _render_from_antenna: Floats) -> dict[str, Any]:
        """Describe Mitsuba's environment map."""
        # Mitsuba's map has y up, and its columns run in the opposite direction.
        image = np.ascontiguousarray(self.image[:, ::-1, None], dtype=np.float32)
        turn = np.eye(4)
        turn[:3, :3] = [[0, 0, -1], [-1, 0, 0], [0, 1, 0]]
        return {"type": "envmap", "bitmap": image, "to_world": turn}


class EnvironmentSpec(LightKind):
    """Light from all around: a laboratory with a window and lamps at its ceiling, or an image.

    The image is an OpenEXR file beside the scene that maps longitude and latitude, its top row
    towards +z, its columns from +x through +y around. `irradiance` is that of plane C.
    """

    kind: Literal["environment"]
    surrounds: ClassVar[bool] = True
    file: EnvironmentName | None = Field(
        default=None, description="OpenEXR image in the scene's folder, by default the laboratory."
    )
    rotation_deg: Turn = Field(default=0, description="Turn of the surroundings about +z.")

    def emitter(self, _setting: LightSetting, files: ImageFiles) -> Environment:
        """Build the map of radiances."""
        image = laboratory() if self.file is None else files.environment(self.file)
        image = rotated(image, self.rotation_deg * DEGREE)
        return Environment(image * self.irradiance / plane_irradiance(image))

    def tangent(self, _setting: LightSetting, sight: Sight) -> Tangent:
        """Return a direction that is hardly known, as of even light."""
        return Tangent(0.0, ENVIRONMENT_SIGMA, EVEN * sight.convergence)


def laboratory() -> Floats:
    """Generate a laboratory: a north window, two rows of ceiling lamps and a dark cupboard."""
    rows = np.clip((np.arange(HEIGHT * SUBPIXELS) + 0.5) / SUBPIXELS - 0.5, 1e-6, HEIGHT - 1 - 1e-6)
    rows *= np.pi / (HEIGHT - 1)
    columns = (np.arange(WIDTH * SUBPIXELS) + 0.5) * 2 * np.pi / (WIDTH * SUBPIXELS)
    polar, azimuth = np.meshgrid(rows, columns, indexing="ij")
    direction = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    )
    low = np.array([-WEST, -SOUTH, -FLOOR])[:, None, None]
    high = np.array([EAST, NORTH, CEILING])[:, None, None]
    # A ray from inside a box leaves through the nearest of the three sides in its direction.
    distance = np.where(direction > 0, high, low) / direction
    side = distance.argmin(axis=0)
    x, y, z = direction * distance.min(axis=0)
    radiance = np.full(side.shape, WALL)
    up, north = (side == 2) & (z > 0), (side == 1) & (y > 0)
    radiance[up] = WHITE_CEILING
    radiance[(side == 2) & (z < 0)] = DARK_FLOOR
    tubes = (abs(abs(y - 0.2) - 1.2) < 0.08) & (abs(x) % 1.5 < 1.2) & (abs(x) < 3)
    radiance[up & tubes] = TUBE
    bars = (abs(x - 0.4) < 0.04) | (abs(z - 0.9) < 0.03)
    window = north & (abs(x - 0.4) < 1.1) & (z > 0.1) & (z < 1.7) & ~bars
    radiance[window] = HORIZON + (SKY - HORIZON) * (z[window] - 0.1) / 1.6
    radiance[(side == 0) & (x < 0) & (y > -1) & (y < 0.5) & (z < 1.1)] = FURNITURE
    pixels = radiance.reshape(HEIGHT, SUBPIXELS, WIDTH, SUBPIXELS)
    return np.asarray(pixels.mean(axis=(1, 3)))


def plane_irradiance(image: Floats) -> float:
    """Integrate the irradiance of a map on a plane that faces +z."""
    height = len(image)
    polar = (np.arange(INTEGRATION_STEPS) + 0.5) * (np.pi / 2) / INTEGRATION_STEPS
    ring = np.interp(polar, np.linspace(0, np.pi, height), image.mean(axis=1))
    return float(2 * np.pi * np.mean(ring * np.cos(polar) * np.sin(polar)) * np.pi / 2)


def rotated(image: Floats, angle: float) -> Floats:
    """Rotate a map about +z by an angle [rad], rounded to whole columns."""
    width = image.shape[1]
    return np.roll(image, round(angle * width / (2 * np.pi)), axis=1)
