"""Rectangular lamp low at the side."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.sheets import rectangle
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.lights.emitter import Lamp
from vbaa_bench.scene.lights.light import ALONG, UP, LightKind, LightSetting, Sides, metres
from vbaa_bench.scene.lights.sight import Sight, Tangent
from vbaa_bench.scene.part import Positive, Turn


class SideSpec(LightKind):
    """Rectangular lamp low at the side; azimuth is measured from +x to +y, in plane C."""

    kind: Literal["side"]
    azimuth_deg: Turn = Field(
        default=-90,
        description="Direction from the camera's look-at to the lamp, in plane C, from +x.",
    )
    elevation_deg: Annotated[float, Field(gt=0, lt=90)] = Field(
        default=15, description="Angle of that direction above plane C."
    )
    distance_mm: Positive = Field(
        default=400, description="Distance of the lamp from the camera's look-at."
    )
    size_mm: Sides = Field(
        default=(400, 100), description="Lengths of the level and the other side."
    )

    def emitter(self, setting: LightSetting, _files: ImageFiles) -> Lamp:
        """Build the lamp, perpendicular to the direction to the camera's look-at."""
        aim = setting.look_at
        away = turn_about_z(self.azimuth_deg * DEGREE)[:3, :3] @ ALONG
        elevation = self.elevation_deg * DEGREE
        direction = np.cos(elevation) * away + np.sin(elevation) * UP
        middle = aim + self.distance_mm * MILLIMETRE * direction
        mesh = rectangle(middle, -direction, np.cross(UP, away), metres(self.size_mm))
        return Lamp.of_irradiance(mesh, aim, self.irradiance)

    def tangent(self, setting: LightSetting, sight: Sight) -> Tangent:
        """Compute the direction to the middle of the lamp."""
        azimuth, elevation = self.azimuth_deg * DEGREE, self.elevation_deg * DEGREE
        ahead = np.array([math.cos(azimuth), math.sin(azimuth), math.tan(elevation)])
        distance = self.distance_mm * math.cos(elevation)
        place = np.array(setting.look_at_mm) + distance * ahead
        return sight.to(place, math.prod(self.size_mm))
