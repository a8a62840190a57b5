"""The image sensor."""

from typing import Annotated, Literal

from pydantic import Field

from vbaa_bench.spec.part import Part


class SensorSpec(Part):
    """The image sensor, exposed so that the resting beam peaks at `beam_peak_pct` of full scale."""

    bits: Literal[8] = 8
    full_well_e: Annotated[float, Field(ge=10, le=1e7)] = 10_000
    read_noise_e: Annotated[float, Field(ge=0, le=1e6)] = 10
    beam_peak_pct: Annotated[float, Field(gt=0, le=100)] = 70
    rest_images: Annotated[int, Field(ge=1, le=1000)] = 4
