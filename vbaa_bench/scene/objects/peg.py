"""A thin upright cylinder."""

from typing import Literal

from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.cylinder import cylinder
from vbaa_bench.scene.objects.object import ObjectSetting, UprightKind
from vbaa_bench.scene.part import Positive


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
