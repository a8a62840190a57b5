"""A thin upright cylinder, and a second one as a second contact."""

from typing import Literal

from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.cylinder import cylinder
from vbaa_bench.scene.objects.object import ObjectSetting, UprightKind
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Below, NonNegative, Positive


class PegSpec(UprightKind):
    """A thin upright cylinder."""

    kind: Literal["peg"]
    radius_mm: Positive = Field(default=1, description="Radius of the peg.")

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return the peg's side."""
        return upright(self.radius_mm * MILLIMETRE)

    def mesh(self, setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Build the peg."""
        return cylinder(self.radius_mm * MILLIMETRE, *self.heights(setting))


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
