"""Things that lie about on the ground, and the edge of the table."""

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.part import Below, Fraction, Part, Positive

Thing = Literal["box", "disc", "nut", "rod", "screwdriver", "cable"]
THINGS: Final[tuple[Thing, ...]] = ("box", "disc", "nut", "rod", "screwdriver", "cable")


class ClutterSpec(Part):
    """Things at random places on the ground, in the camera's view, fixed to the ground.

    Their largest sides are log-uniform between the ends of `size_mm`, and their reflectances
    uniform; they are painted matt or gloss, or of bare steel. None is higher than `top_mm`, by
    default half-way from the ground to plane C: none is between the camera and the beam. They lie
    where neither the object nor, unless `under_beam` is set, the beam above them passes. If there
    is no room for all, fewer lie there.
    """

    count: Annotated[int, Field(ge=1, le=100)] = 12
    size_mm: tuple[Positive, Positive] = (8, 40)
    reflectance: tuple[Fraction, Fraction] = (0.04, 0.5)
    things: Annotated[tuple[Thing, ...], Field(min_length=1)] = THINGS
    top_mm: Below | None = None
    under_beam: bool = False

    @model_validator(mode="after")
    def _check_ranges(self) -> "ClutterSpec":
        for name in ("size_mm", "reflectance"):
            limits = getattr(self, name)
            if limits[0] > limits[1]:
                raise ValueError(f"{name} is {list(limits)}, allowed is a range from low to high")
        return self

    def highest_mm(self, ground_mm: float) -> float:
        """Return the height of the highest top above plane C, given that of the ground."""
        return ground_mm / 2 if self.top_mm is None else self.top_mm


class EdgeSpec(Part):
    """The ground's straight edge, `distance_mm` from the beam's middle towards `azimuth_deg`.

    Behind it is a floor, `drop_mm` lower. Azimuth is measured from +x to +y, in plane C.
    """

    distance_mm: Positive = 60
    azimuth_deg: Annotated[float, Field(ge=-360, le=360)] = 90
    drop_mm: Positive = 300
    thickness_mm: Positive = 25
    side_reflectance: Fraction = 0.2
    floor_reflectance: Fraction = 0.12
