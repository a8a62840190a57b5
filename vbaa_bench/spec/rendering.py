"""How finely a scene is rendered, and which truth layers are kept."""

from typing import Annotated, Literal

from pydantic import Field

from vbaa_bench.spec.part import Part

Layer = Literal["radiance", "beam_mask", "arc_length", "depth", "object_index"]


class RenderSpec(Part):
    """Samples per pixel: square numbers, so that every pixel is stratified in both directions."""

    samples_near_beam: Literal[16, 64, 256, 1024] = 256
    samples_elsewhere: Literal[4, 16, 64, 256] = 16
    near_beam_px: Annotated[int, Field(ge=1, le=64)] = 5
