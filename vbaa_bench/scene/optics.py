"""Effects of a real lens other than projection. All are off by default."""

from typing import Annotated

from pydantic import Field

from vbaa_bench.scene.part import NonNegative, Part, Positive


class OpticsSpec(Part):
    """Point spread, depth of field and vignetting."""

    point_spread_px: Annotated[float, Field(ge=0, le=20)] = Field(
        default=0.0, description="Sigma of a Gaussian point spread."
    )
    aperture_mm: NonNegative = Field(
        default=0.0, description="Diameter of the entrance pupil; with 0 everything is in focus."
    )
    focus_distance_mm: Positive | None = Field(
        default=None, description="Depth in focus; by default that of the look-at point."
    )
    vignetting_pct: Annotated[float, Field(ge=0, le=90)] = Field(
        default=0.0, description="Darkening of the image's corners relative to its middle."
    )
