"""Colour filters of the image sensor."""

from typing import Annotated, Literal

from pydantic import Field

from vbaa_bench.scene.part import Part

_Signal = Annotated[float, Field(ge=0.01, le=1)]


class BayerSpec(Part):
    """Bayer mosaic over the photosites; images are reconstructed in colour and converted to gray.

    All surfaces and lamps are gray: a channel differs from another only by its signal, the
    product of the lamp's colour and the filter's sensitivity. The exposure is metered in the most
    sensitive channel.
    """

    pattern: Literal["rggb", "bggr", "grbg", "gbrg"] = Field(
        default="rggb", description="The photosites of the upper left corner, row by row."
    )
    red: _Signal = Field(
        default=0.6, description="Signal of the red photosites, relative to the others."
    )
    green: _Signal = Field(
        default=1.0, description="Signal of the green photosites, relative to the others."
    )
    blue: _Signal = Field(
        default=0.5, description="Signal of the blue photosites, relative to the others."
    )
    white_balance: bool = Field(
        default=True,
        description="Whether the channels are scaled to the same signal of a gray surface.",
    )
    demosaicing: Literal["bilinear", "edge_aware"] = Field(
        default="bilinear", description="How the colours between photosites are reconstructed."
    )
