"""Paint, reflectance and grime of parts."""

from typing import Annotated, Literal

from pydantic import Field

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


class GrimeSpec(Part):
    """Smudges, dust and uneven gloss along the beam and around it, drawn at random.

    Contrast is the standard deviation of reflectance over its mean. Specks of dust have their own
    reflectance and do not shine. The gloss varies from its full value down by `uneven_gloss` of it.
    """

    smudge_contrast: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.12, description="Standard deviation of reflectance over its mean."
    )
    smudge_mm: Positive = Field(default=12, description="Size of the smudges.")
    dust_pct: Annotated[float, Field(ge=0, le=50)] = Field(
        default=2, description="Share of the surface that specks of dust cover."
    )
    dust_mm: Positive = Field(default=0.15, description="Size of the specks.")
    dust_reflectance: Fraction = Field(
        default=0.45, description="Reflectance of the specks, which do not shine."
    )
    uneven_gloss: Fraction = Field(
        default=0.5, description="Share of the gloss by which it varies, from its full value down."
    )
