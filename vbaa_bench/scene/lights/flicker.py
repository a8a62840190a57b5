"""Flicker of all lamps."""

from typing import Annotated

from pydantic import Field

from vbaa_bench.scene.part import Part


class FlickerSpec(Part):
    """Power of all lamps on alternating current: 1 + depth cos(2 pi 2 mains_hz t + phase).

    The phase is drawn for every image, also for those of the board and of the beam at rest. An
    image integrates the power over its exposure; a rolling shutter shows it as bands.
    """

    mains_hz: Annotated[float, Field(ge=1, le=1e5)] = Field(
        default=50.0, description="Frequency of the alternating current, half that of the light."
    )
    depth_pct: Annotated[float, Field(ge=0, le=100)] = Field(
        description="Largest change of the light over its mean."
    )
