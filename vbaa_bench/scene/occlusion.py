"""Occluders that hide the beam from the camera."""

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Fraction, Positive

# The kind that hides nothing in the image.
REMOVED: Final = "removed"


class OcclusionSpec(PaintedPart):
    """Occlusions of the beam: every frame is repeated for every kind, place and availability.

    Availability is the paper's AR (eq. 32): the visible fraction of the beam's length.
    The hidden segment begins at the clamp, is about the contact or the middle, or ends at the
    tip. `removed` hides nothing in the image; the solver ignores that segment instead, as in the
    paper. The others are bodies between beam and camera.
    """

    kind: Annotated[
        tuple[Literal["removed", "sheet", "bars", "leaves"], ...], Field(min_length=1)
    ] = Field(
        description="Bodies between beam and camera, or removed: nothing in the image, but "
        "the solver ignores the segment."
    )
    place: Annotated[
        tuple[Literal["base", "contact", "middle", "tip"], ...], Field(min_length=1)
    ] = Field(
        default=("contact",),
        description="Place of the hidden segment: from the clamp, about the contact or the "
        "middle, or up to the tip.",
    )
    availability: Annotated[
        tuple[Annotated[float, Field(gt=0, le=1)], ...], Field(min_length=1)
    ] = Field(
        default=(0.6,),
        description="The paper's AR (eq. 32): visible fraction of the beam's length.",
    )
    height_mm: Positive = Field(
        default=8, description="Height of the bodies above the beam and the object."
    )
    reflectance: Fraction = Field(default=0.12, description="Reflectance of matt and gloss paint.")
    count: Annotated[int, Field(ge=1, le=200)] = Field(
        default=6,
        description="Number of bars, with gaps between them, or of leaves, at random places.",
    )

    @model_validator(mode="after")
    def _check_bodies(self) -> "OcclusionSpec":
        bodies = set(self.kind) - {REMOVED}
        if len(bodies) > 1:
            raise ValueError(
                f"kind is {list(self.kind)}, allowed is removed and one of sheet, bars, leaves"
            )
        return self

    @property
    def body(self) -> str | None:
        """Kind of the occluding body in frames whose cover is not `removed`, or None."""
        return next((kind for kind in self.kind if kind != REMOVED), None)
