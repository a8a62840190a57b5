"""Paint, reflectance, textures and grime of parts."""

from typing import Annotated, Literal

from pydantic import Field

from vbaa_bench.scene.files import ImageName
from vbaa_bench.scene.part import Fraction, Part, Positive

# Matt; painted steel; steel without paint; matt black.
Paint = Literal["matt", "gloss", "bare", "black"]


class PaintedPart(Part):
    """Part with a paint; its `reflectance` is that of matt and gloss paint.

    Bare steel has the reflectance of iron, and matt black has 0.03.
    """

    paint: Paint = Field(
        default="matt",
        description="Surface: matt paint, painted steel, steel without paint, or matt black.",
    )
    reflectance: Fraction = Field(
        default=0.16, description="Reflectance of matt and gloss paint; others have their own."
    )
    # Below, the narrow reflection could not be sampled; above, the surface would lose light between
    # its own slopes.
    roughness: Annotated[float, Field(ge=0.1, le=0.6)] = Field(
        default=0.3, description="Roughness alpha of the surface of gloss and bare."
    )


class ImageTextureSpec(Part):
    """An image beside the scene: a PNG or JPEG, or OpenEXR file in the scene's folder or below.

    It is repeated, `width_mm` wide. Its mean is the part's `reflectance`; gray values of PNG and
    JPEG are decoded by the curve of sRGB.
    """

    kind: Literal["image"]
    file: ImageName
    width_mm: Positive = 50


class BrushedTextureSpec(Part):
    """Lines of a brush or a cutter; contrast is the standard deviation of reflectance over it.

    `direction_deg` is from the part's x, along the beam, to its y.
    """

    kind: Literal["brushed"]
    contrast: Annotated[float, Field(gt=0, le=1)] = 0.3
    line_mm: Positive = 0.15
    line_ratio: Annotated[float, Field(ge=1, le=100)] = 60
    direction_deg: Annotated[float, Field(ge=-360, le=360)] = 20


class SpeckleTextureSpec(Part):
    """Printed speckles, as for image correlation."""

    kind: Literal["speckle"]
    speckle_mm: Positive = 0.8
    cover_pct: Annotated[float, Field(gt=0, lt=100)] = 40
    speckle_reflectance: Fraction = 0.04


TextureSpec = Annotated[
    ImageTextureSpec | BrushedTextureSpec | SpeckleTextureSpec, Field(discriminator="kind")
]


class GrimeSpec(Part):
    """Smudges, dust and uneven gloss along the beam and around it, drawn at random.

    Contrast is the standard deviation of reflectance over its mean. Specks of dust have their own
    reflectance and do not shine. The gloss varies from its full value down by `uneven_gloss` of it.
    """

    smudge_contrast: Annotated[float, Field(ge=0, le=1)] = 0.12
    smudge_mm: Positive = 12
    dust_pct: Annotated[float, Field(ge=0, le=50)] = 2
    dust_mm: Positive = 0.15
    dust_reflectance: Fraction = 0.45
    uneven_gloss: Fraction = 0.5
