"""Lines of a brush or a cutter."""

from typing import Annotated, Literal

from pydantic import Field

from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.textures import Texture, random_texture
from vbaa_bench.scene.part import Positive, Turn
from vbaa_bench.scene.textures.texture import TextureKind, TextureSetting


class BrushedTextureSpec(TextureKind):
    """Lines of a brush or a cutter; contrast is the standard deviation of reflectance over it.

    `direction_deg` is from the part's x, along the beam, to its y.
    """

    kind: Literal["brushed"]
    contrast: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.3, description="Standard deviation of the reflectance over its mean."
    )
    line_mm: Positive = Field(default=0.15, description="Correlation length across the lines.")
    line_ratio: Annotated[float, Field(ge=1, le=100)] = Field(
        default=60, description="Correlation length along the lines over that across them."
    )
    direction_deg: Turn = Field(
        default=20, description="Direction of the lines, from the part's x to its y."
    )

    def texture(self, setting: TextureSetting) -> Texture:
        """Draw the lines."""
        turn = turn_about_z(-self.direction_deg * DEGREE)[:2, :2]
        mm = MILLIMETRE
        lengths = (self.line_mm * self.line_ratio * mm, self.line_mm * mm)
        places, repeat = setting.places @ turn.T, 2 * setting.extent
        return random_texture(places, setting.mean, self.contrast, lengths, repeat, setting.random)
