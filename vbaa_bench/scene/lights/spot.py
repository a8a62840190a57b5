"""Small lamp that lights a cone."""

from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply
from solver.instrument.units import DEGREE
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.lights.emitter import Emitter, pose_towards
from vbaa_bench.scene.lights.light import AimedKind, LightSetting
from vbaa_bench.scene.part import Triple

# Fraction of a spot's cone beyond which its intensity fades.
UNIFORM_FRACTION: Final = 0.75


@dataclass(frozen=True)
class Spot(Emitter):
    """A point source that lights a cone of full angle `cone` [rad] about its aim.

    `position` and `aim` are (3,); `irradiance` is that on a sheet at the aim that faces the spot.
    """

    position: Floats
    aim: Floats
    cone: float
    irradiance: float

    def extent(self) -> Floats:
        """Return the position."""
        return self.position[None]

    def description(self, render_from_antenna: Floats) -> dict[str, Any]:
        """Describe Mitsuba's spot."""
        position, aim = apply(render_from_antenna, np.array([self.position, self.aim]))
        distance = float(np.linalg.norm(aim - position))
        half = float(np.rad2deg(self.cone / 2))
        # A cone is round: any direction not parallel to its axis will do.
        across = np.eye(3)[np.abs(aim - position).argmin()]
        return {
            "type": "spot",
            # Intensity is per solid angle: the distance must be in render coordinates.
            "intensity": {"type": "rgb", "value": self.irradiance * distance**2},
            "cutoff_angle": half,
            "beam_width": UNIFORM_FRACTION * half,
            "to_world": pose_towards(position, aim, across),
        }


class SpotSpec(AimedKind):
    """Small lamp that lights a cone and casts hard shadows."""

    kind: Literal["spot"]
    position_mm: Triple = Field(default=(0.0, -200.0, 350.0), description="Position of the lamp.")
    cone_angle_deg: Annotated[float, Field(ge=1, le=170)] = Field(
        default=60, description="Full angle of the cone, of which the outer quarter fades."
    )

    def emitter(self, setting: LightSetting, _files: ImageFiles) -> Spot:
        """Build the point source."""
        position, aim = self.ends(setting)
        return Spot(position, aim, self.cone_angle_deg * DEGREE, self.irradiance)
