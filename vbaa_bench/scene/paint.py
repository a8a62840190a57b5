"""Paint and reflectance of parts."""

from typing import Annotated, Literal

from pydantic import Field

from vbaa_bench.scene.part import Fraction, Part

# Matt; painted steel; steel without paint; matt black.
Paint = Literal["matt", "gloss", "bare", "black"]


class PaintedPart(Part):
    """Part with a paint; its `reflectance` is that of matt and gloss paint.

    Bare steel has the reflectance of iron, and matt black has 0.03.
    """

    paint: Paint = "matt"
    reflectance: Fraction = 0.16
    # Alpha of the rough surface of gloss and bare. Below, the narrow reflection could not be
    # sampled; above, the surface would lose light between its own slopes.
    roughness: Annotated[float, Field(ge=0.1, le=0.6)] = 0.3
