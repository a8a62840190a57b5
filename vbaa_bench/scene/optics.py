"""Effects of a real lens other than projection. All are off by default."""

from typing import Annotated

from pydantic import Field

from vbaa_bench.scene.part import NonNegative, Part, Positive


class OpticsSpec(Part):
    """Point spread, depth of field and vignetting."""

    # Sigma of a Gaussian point spread.
    point_spread_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    # Diameter of the entrance pupil, and the depth in focus: by default that of the look-at
    # point.
    aperture_mm: NonNegative = 0.0
    focus_distance_mm: Positive | None = None
    # Darkening of the image's corners relative to its middle.
    vignetting_pct: Annotated[float, Field(ge=0, le=90)] = 0.0
