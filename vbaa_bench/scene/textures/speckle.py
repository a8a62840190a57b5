"""Printed speckles."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.geometry.textures import MAX_TEXELS, TEXEL, Texture
from vbaa_bench.scene.part import Fraction, Positive
from vbaa_bench.scene.textures.texture import TextureKind, TextureSetting


class SpeckleTextureSpec(TextureKind):
    """Printed speckles, as for image correlation."""

    kind: Literal["speckle"]
    speckle_mm: Positive = Field(default=0.8, description="Size of a speckle.")
    cover_pct: Annotated[float, Field(gt=0, lt=100)] = Field(
        default=40, description="Share of the surface that speckles cover."
    )
    speckle_reflectance: Fraction = Field(default=0.04, description="Reflectance of speckles.")

    def texture(self, setting: TextureSetting) -> Texture:
        """Draw the speckles."""
        size, cover = self.speckle_mm * MILLIMETRE, self.cover_pct * PERCENT
        tones, repeat = (setting.mean, self.speckle_reflectance), 2 * setting.extent
        return speckle_texture(setting.places, tones, size, cover, repeat, setting.random)


def speckle_texture(
    places: Floats,
    reflectances: tuple[float, float],
    size: float,
    cover: float,
    extent: float,
    random: np.random.Generator,
) -> Texture:
    """Create printed speckles at `places` (n, 2) that repeat after `extent`.

    Speckles of about the given `size` with the second of two `reflectances` cover the fraction
    `cover`.
    """
    from scipy.ndimage import gaussian_filter  # takes a tenth of a second, for this kind alone

    texel = size * TEXEL
    side = int(min(np.ceil(extent / texel), MAX_TEXELS))
    noise = random.standard_normal((side, side))
    # With this sigma, where the field is below its lowest 30 to 40 %, is about `size` wide.
    field = gaussian_filter(noise, size / (3 * texel), mode="wrap")
    image = np.where(field < np.quantile(field, cover), reflectances[1], reflectances[0])
    return Texture(image, places / (texel * side), repeated=True)
