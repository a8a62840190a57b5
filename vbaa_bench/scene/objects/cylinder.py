"""An upright cylinder."""

from typing import Literal

import numpy as np
from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import arc, prism, side_count
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.object import ObjectSetting, UprightKind
from vbaa_bench.scene.part import Positive


class CylinderSpec(UprightKind):
    """An upright cylinder."""

    kind: Literal["cylinder"]
    radius_mm: Positive = Field(default=10, description="Radius of the cylinder.")

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return the cylinder's side."""
        return upright(self.radius_mm * MILLIMETRE)

    def mesh(self, setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Build the cylinder."""
        return cylinder(self.radius_mm * MILLIMETRE, *self.heights(setting))


def cylinder(radius: float, bottom: float, top: float, sections: int = 128) -> Mesh:
    """Mesh an upright cylinder about y = -radius, with at least `sections` sides.

    A line of vertices passes through the origin.
    """
    n = side_count(radius, sections)
    return prism(arc(radius, 2 * np.pi * np.arange(n) / n), bottom, top)
