"""Rectangular lamp anywhere."""

import math
from typing import Literal

import numpy as np
from pydantic import Field

from vbaa_bench.geometry.sheets import rectangle
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.lights.emitter import Lamp
from vbaa_bench.scene.lights.light import ALONG, AimedKind, LightSetting, Sides, metres
from vbaa_bench.scene.lights.sight import Sight, Tangent
from vbaa_bench.scene.part import Triple


class AreaSpec(AimedKind):
    """Rectangular lamp anywhere; its first side is as parallel to the beam as possible."""

    kind: Literal["area"]
    position_mm: Triple = Field(default=(120.0, -250.0, 420.0), description="Middle of the lamp.")
    size_mm: Sides = Field(
        default=(300, 200), description="Lengths of the first and the second side."
    )

    def emitter(self, setting: LightSetting, _files: ImageFiles) -> Lamp:
        """Build the lamp, perpendicular to the direction to its aim."""
        position, aim = self.ends(setting)
        mesh = rectangle(position, aim - position, ALONG, metres(self.size_mm))
        return Lamp.of_irradiance(mesh, aim, self.irradiance)

    def tangent(self, _setting: LightSetting, sight: Sight) -> Tangent:
        """Compute the direction to the middle of the lamp."""
        return sight.to(np.array(self.position_mm), math.prod(self.size_mm))
