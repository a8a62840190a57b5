"""Even light from all directions, beside the other lights of a scene."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Final

from pydantic import Field

from solver.instrument.arrays import Floats
from vbaa_bench.scene.lights.emitter import Emitter
from vbaa_bench.scene.lights.sight import PLACE_SIGMA, Sight, Tangent
from vbaa_bench.scene.part import Part

# Shift of a cylinder's shading in even light from the half-space above it, over that in light from
# one direction. Derived, as SHADING in the solver: brightness (1 + sqrt(1 - x^2)) / 2 + t x / 2.
EVEN: Final = (math.pi / 4) / (1 + math.pi / 4)


@dataclass(frozen=True)
class Ambient(Emitter):
    """Infinitely distant light of the same `radiance` from all directions."""

    radiance: float

    def extent(self) -> None:
        """Return None: it is infinitely far."""

    def description(self, _render_from_antenna: Floats) -> dict[str, Any]:
        """Describe Mitsuba's constant light."""
        return {"type": "constant", "radiance": {"type": "rgb", "value": self.radiance}}


class AmbientSpec(Part):
    """Even light from all directions, in addition to `light` or `lights`.

    `irradiance` is that of plane C where the camera looks: over that by the soft lamp of `light`,
    or in the unit of the irradiances in `lights`, of which each has 1 by default.
    """

    irradiance: Annotated[float, Field(ge=1e-6, le=100)] = Field(
        default=0.3,
        description="Irradiance of plane C, relative to the soft lamp's or to a light's unit.",
    )

    def tangent(self, sight: Sight) -> Tangent:
        """Compute the mean direction of the light, straight down."""
        return Tangent(-EVEN * sight.to_camera, PLACE_SIGMA, EVEN * sight.convergence)
