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

    # The photosites of the upper left corner, row by row.
    pattern: Literal["rggb", "bggr", "grbg", "gbrg"] = "rggb"
    # Only ratios matter.
    red: _Signal = 0.6
    green: _Signal = 1.0
    blue: _Signal = 0.5
    white_balance: bool = True
    demosaicing: Literal["bilinear", "edge_aware"] = "bilinear"
