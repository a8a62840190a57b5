"""A wedge with a sharp edge."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import prism
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.object import ObjectSetting, Touchable, TouchedKind
from vbaa_bench.scene.part import Positive


class KnifeEdgeSpec(TouchedKind):
    """A wedge; `pushes.normal_deg` tilts its normal nu out of plane C."""

    sharp: ClassVar[bool] = True
    linear: ClassVar[bool] = True

    kind: Literal["knife_edge"]
    length_mm: Positive = Field(default=40, description="Length of the edge.")
    depth_mm: Positive = Field(default=15, description="Depth of the wedge, behind its edge.")
    half_angle_deg: Annotated[float, Field(gt=0, lt=80)] = Field(
        default=20, description="Angle between the middle of the wedge and each flank."
    )

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return an edge."""
        return upright()

    def touchable(self, _setting: ObjectSetting) -> Touchable:
        """Return the edge, between the flanks."""
        half = self.length_mm * MILLIMETRE / 2
        return Touchable(-half, half, flank=math.pi / 2 - self.half_angle_deg * DEGREE)

    def mesh(self, _setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Build the wedge."""
        mm = MILLIMETRE
        return knife_edge(self.length_mm * mm, self.depth_mm * mm, self.half_angle_deg * DEGREE)


def knife_edge(length: float, depth: float, half_angle: float) -> Mesh:
    """Mesh a wedge whose apex runs along z, `length` about the origin; it opens towards -y.

    Its flanks are at `half_angle` [rad] to either side of -y and reach down to y = -depth.
    """
    half = depth * np.tan(half_angle)
    outline = np.array([[0.0, 0.0], [-half, -depth], [half, -depth]])
    return prism(outline, -length / 2, length / 2)
