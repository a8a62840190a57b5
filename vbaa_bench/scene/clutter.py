"""Things that lie about on the ground."""

from typing import Annotated, get_args

from pydantic import Field, model_validator

from vbaa_bench.geometry.clutter import Thing
from vbaa_bench.scene.part import Below, Fraction, Part, Positive, check_order


class ClutterSpec(Part):
    """Things at random places on the ground, in the camera's view, fixed to the ground.

    Their largest sides are log-uniform between the ends of `size_mm`, and their reflectances
    uniform; they are painted matt or gloss, or of bare steel. None is higher than `top_mm`, by
    default half-way from the ground to plane C: none is between the camera and the beam. They lie
    where neither the object nor, unless `under_beam` is set, the beam above them passes. If there
    is no room for all, fewer lie there.
    """

    count: Annotated[int, Field(ge=1, le=100)] = Field(
        default=12, description="Number of things; fewer lie there if there is no room."
    )
    size_mm: tuple[Positive, Positive] = Field(
        default=(8, 40), description="Range of the largest side."
    )
    reflectance: tuple[Fraction, Fraction] = Field(
        default=(0.04, 0.5), description="Range of the reflectance."
    )
    things: Annotated[tuple[Thing, ...], Field(min_length=1)] = Field(
        default=get_args(Thing), description="Kinds of things of which each is drawn."
    )
    top_mm: Below | None = Field(
        default=None,
        description="Height of the highest top above plane C; by default half-way from the "
        "ground to plane C.",
    )
    under_beam: bool = Field(
        default=False, description="Whether things may lie where the beam passes above them."
    )

    @model_validator(mode="after")
    def _check_ranges(self) -> "ClutterSpec":
        for name in ("size_mm", "reflectance"):
            check_order(name, getattr(self, name))
        return self

    def highest_mm(self, ground_mm: float) -> float:
        """Return the height of the highest top above plane C, given that of the ground."""
        return ground_mm / 2 if self.top_mm is None else self.top_mm
