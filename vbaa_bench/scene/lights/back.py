"""Luminous panel behind the beam."""

from typing import Literal

import numpy as np
from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.sheets import rectangle
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.lights.emitter import Lamp
from vbaa_bench.scene.lights.light import ALONG, UP, LightKind, LightSetting, Sides, metres
from vbaa_bench.scene.lights.sight import NO_SHADING, Sight, Tangent
from vbaa_bench.scene.part import Positive


class BackSpec(LightKind):
    """Luminous panel that is `height_above_background_mm` above the background and shines upwards.

    `irradiance` is that of plane C from below.
    """

    kind: Literal["back"]
    size_mm: Sides = Field(default=(400, 400), description="Lengths along the beam and across it.")
    height_above_background_mm: Positive = Field(
        default=0.5, description="Height of the panel above the background."
    )

    def mistake(self, setting: LightSetting) -> str | None:
        """Describe a panel above plane C."""
        if self.height_above_background_mm < setting.ground_mm:
            return None
        return (
            "a back panel's height_above_background_mm is "
            f"{self.height_above_background_mm:g}, allowed is less than background.distance_mm, "
            f"{setting.ground_mm:g}, or it would be above plane C"
        )

    def panel_mm(self, setting: LightSetting) -> float:
        """Return the height of the panel."""
        return self.height_above_background_mm - setting.ground_mm

    def emitter(self, setting: LightSetting, _files: ImageFiles) -> Lamp:
        """Build the panel, facing up, below the camera's look-at."""
        x, y, _ = setting.look_at
        middle = np.array([x, y, self.panel_mm(setting) * MILLIMETRE])
        mesh = rectangle(middle, UP, ALONG, metres(self.size_mm))
        return Lamp.of_irradiance(mesh, middle * [1, 1, 0], self.irradiance)

    def tangent(self, _setting: LightSetting, _sight: Sight) -> Tangent:
        """Return no shading: in front of a panel the beam is a shadow."""
        return NO_SHADING
