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

    smudge_contrast: Annotated[float, Field(ge=0, le=1)] = 0.12
    smudge_mm: Positive = 12
    dust_pct: Annotated[float, Field(ge=0, le=50)] = 2
    dust_mm: Positive = 0.15
    dust_reflectance: Fraction = 0.45
    uneven_gloss: Fraction = 0.5
