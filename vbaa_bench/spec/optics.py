"""What a real lens does beside projecting. All off unless asked."""

from typing import Annotated

from pydantic import Field

from vbaa_bench.spec.part import NonNegative, Part, Positive


class OpticsSpec(Part):
    """Point spread, depth of field and vignetting."""

    # Sigma of a Gaussian point spread.
    spread_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    # Diameter of the entrance pupil, and the depth that is sharp: without, that of the point
    # looked at.
    aperture_mm: NonNegative = 0.0
    focus_mm: Positive | None = None
    # How much darker the image's corners are than its middle.
    vignetting_pct: Annotated[float, Field(ge=0, le=90)] = 0.0
