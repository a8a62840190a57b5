"""Thin wires, such as other whiskers, that cross the beam in the image without touching it."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.part import Below, Fraction, Part, Positive

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

    count: Annotated[int, Field(ge=1, le=100)] = 6
    # Heights above plane C between which the wires are evenly spread.
    height_mm: tuple[Below, Below] = (-20, -10)
    diameter_mm: tuple[Positive, Positive] = (0.4, 0.8)
    length_mm: tuple[Positive, Positive] = (100, 300)
    tip_ratio: tuple[TipRatio, TipRatio] = (0.1, 1.0)
    bow_pct: tuple[Bow, Bow] = (-5, 5)
    crossing_deg: tuple[Crossing, Crossing] = (20, 160)
    paint: Literal["matt", "gloss", "bare"] = "gloss"
    roughness: Annotated[float, Field(ge=0.1, le=0.6)] = 0.3
    reflectance: tuple[Fraction, Fraction] = (0.1, 0.6)

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
            limits = getattr(self, name)
            if limits[0] > limits[1]:
                raise ValueError(f"{name} is {list(limits)}, allowed is a range from low to high")
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
