"""Ring lamp about the lens."""

from typing import Literal

from pydantic import Field, model_validator

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.sheets import annulus
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.lights.emitter import Lamp
from vbaa_bench.scene.lights.light import LightKind, LightSetting
from vbaa_bench.scene.lights.sight import NO_SHADING, Sight, Tangent
from vbaa_bench.scene.part import Positive


class RingSpec(LightKind):
    """Ring lamp about the lens, perpendicular to the camera's axis, with two radii."""

    kind: Literal["ring"]
    inner_radius_mm: Positive = Field(default=35, description="Radius of the hole for the lens.")
    outer_radius_mm: Positive = Field(default=60, description="Radius of the ring.")

    @model_validator(mode="after")
    def _check_radii(self) -> "RingSpec":
        if self.inner_radius_mm >= self.outer_radius_mm:
            raise ValueError(
                f"inner_radius_mm is {self.inner_radius_mm:g}, allowed is less than "
                f"outer_radius_mm, {self.outer_radius_mm:g}"
            )
        return self

    def emitter(self, setting: LightSetting, _files: ImageFiles) -> Lamp:
        """Build the ring about the camera, facing its look-at."""
        camera, aim = setting.camera, setting.look_at
        radii = self.inner_radius_mm * MILLIMETRE, self.outer_radius_mm * MILLIMETRE
        return Lamp.of_irradiance(annulus(camera, aim - camera, *radii), aim, self.irradiance)

    def tangent(self, _setting: LightSetting, _sight: Sight) -> Tangent:
        """Return the direction to the camera."""
        return NO_SHADING
