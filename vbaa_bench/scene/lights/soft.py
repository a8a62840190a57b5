"""The soft lamp of a scene without other lights."""

import numpy as np
from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.sheets import sheet
from vbaa_bench.scene.lights.emitter import Lamp
from vbaa_bench.scene.lights.light import LightSetting
from vbaa_bench.scene.lights.sight import Sight, Tangent
from vbaa_bench.scene.part import Part, Positive


class LightSpec(Part):
    """Square lamp that faces plane C, about the camera's axis and behind the camera."""

    side_mm: Positive = Field(default=700, description="Side of the square.")
    height_mm: Positive = Field(default=420, description="Height of the lamp above plane C.")

    def emitter(self, setting: LightSetting, *, raised: bool) -> Lamp:
        """Build the lamp of radiance 1; `raised` to above the camera where it is lower."""
        x, y, z = setting.camera_mm
        height = max(self.height_mm, 1.1 * z) if raised else self.height_mm
        middle = np.array([x, y, height]) * MILLIMETRE
        return Lamp(sheet(middle, self.side_mm * MILLIMETRE, -1))

    def tangent(self, setting: LightSetting, sight: Sight) -> Tangent:
        """Compute the direction to the middle of the lamp."""
        return sight.to(np.array([*setting.camera_mm[:2], self.height_mm]), self.side_mm**2)
