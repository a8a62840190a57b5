"""A second contact."""

from pydantic import Field

from vbaa_bench.scene.objects.peg import PegSpec
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Below, NonNegative, Positive


class SecondPegSpec(PaintedPart):
    """A peg on the other side of the beam, `gap_mm` from it at rest: a second contact."""

    distance_mm: Positive = Field(description="Contact distance of the peg along the beam.")
    gap_mm: NonNegative = Field(default=1.0, description="Distance from the side of the beam.")
    radius_mm: Positive = Field(default=1.0, description="Radius of the peg.")
    top_mm: NonNegative = Field(default=0.4, description="Height of the top above plane C.")
    bottom_mm: Below | None = Field(
        default=None, description="Height of the bottom; by default it stands on the background."
    )

    @property
    def peg(self) -> PegSpec:
        """The peg as an object of its own."""
        return PegSpec(
            kind="peg", radius_mm=self.radius_mm, top_mm=self.top_mm, bottom_mm=self.bottom_mm
        )
