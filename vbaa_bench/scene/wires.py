"""Thin wires, such as other whiskers, that cross the beam in the image without touching it."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.paint import Roughness
from vbaa_bench.scene.part import Below, Fraction, Part, Positive, check_order

TipRatio = Annotated[float, Field(ge=0.02, le=1)]
Bow = Annotated[float, Field(ge=-20, le=20)]
Crossing = Annotated[float, Field(ge=1, le=179)]


class WiresSpec(Part):
    """Wires below the beam and the object, each level and at a height of its own.

    They are fixed to the ground. Seen from above, each crosses the straight beam at a uniform place
    from a tenth of the length to the tip; `crossing_deg` is the angle from the beam's direction to
    the wire's. Diameters at the thick end and lengths are log-uniform between the ends of their
    ranges; tip ratios, bows (sagitta over length), angles and reflectances are uniform. A wire that
    would meet the hub is placed anew; if there is no room for it, it is left out.
    """

    count: Annotated[int, Field(ge=1, le=100)] = Field(default=6, description="Number of wires.")
    height_mm: tuple[Below, Below] = Field(
        default=(-20, -10),
        description="Range of heights above plane C, between whose ends the wires are evenly "
        "spread.",
    )
    diameter_mm: tuple[Positive, Positive] = Field(
        default=(0.4, 0.8), description="Range of the diameter at the thick end."
    )
    length_mm: tuple[Positive, Positive] = Field(
        default=(100, 300), description="Range of the length."
    )
    tip_ratio: tuple[TipRatio, TipRatio] = Field(
        default=(0.1, 1.0),
        description="Range of the diameter at the thin end over that at the thick end.",
    )
    bow_pct: tuple[Bow, Bow] = Field(
        default=(-5, 5), description="Range of the sagitta over the length."
    )
    crossing_deg: tuple[Crossing, Crossing] = Field(
        default=(20, 160), description="Range of the angle from the beam's direction to the wire's."
    )
    paint: Literal["matt", "gloss", "bare"] = Field(
        default="gloss", description="Paint of the wires."
    )
    roughness: Roughness = Field(
        default=0.3, description="Roughness alpha of gloss paint and bare steel."
    )
    reflectance: tuple[Fraction, Fraction] = Field(
        default=(0.1, 0.6), description="Range of the reflectance."
    )

    @model_validator(mode="after")
    def _check_ranges(self) -> "WiresSpec":
        for name in (
            "height_mm",
            "diameter_mm",
            "length_mm",
            "tip_ratio",
            "bow_pct",
            "crossing_deg",
            "reflectance",
        ):
            check_order(name, getattr(self, name))
        return self

    @model_validator(mode="after")
    def _check_apart(self) -> "WiresSpec":
        height, thickest = self.height_mm[1] - self.height_mm[0], self.diameter_mm[1]
        if height < (self.count - 1) * thickest:
            raise ValueError(
                f"height_mm is {list(self.height_mm)}, allowed is a range of at least "
                f"{(self.count - 1) * thickest:g} for {self.count} wires of up to {thickest:g} mm, "
                "or they would touch each other"
            )
        return self

    @property
    def highest_mm(self) -> float:
        """Height of the highest point above plane C."""
        return self.height_mm[1] + self.diameter_mm[1] / 2

    @property
    def lowest_mm(self) -> float:
        """Height of the lowest point above plane C."""
        return self.height_mm[0] - self.diameter_mm[1] / 2
