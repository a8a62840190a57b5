"""A square block."""

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import lofted, prism
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.object import ObjectSetting, Touchable, UprightKind
from vbaa_bench.scene.part import NonNegative, Positive


class BlockSpec(UprightKind):
    """A square block; one of its upright edges touches the beam.

    A chamfer is on the edges of its top only. The touched edge keeps its place, but ends
    `chamfer_mm` below the top, and still above plane C.
    """

    sharp: ClassVar[bool] = True
    linear: ClassVar[bool] = True

    kind: Literal["block"] = "block"
    side_mm: Positive = Field(default=12, description="Side of the square.")
    chamfer_mm: NonNegative = Field(
        default=0, description="Width of the chamfer of the top's edges, at 45 degrees."
    )

    @model_validator(mode="after")
    def _check_chamfer(self) -> "BlockSpec":
        most = min(self.top_mm, self.side_mm / 2)
        if self.chamfer_mm and self.chamfer_mm >= most:
            raise ValueError(
                f"chamfer_mm is {self.chamfer_mm:g}, allowed is less than top_mm and than half of "
                f"side_mm, {most:g}"
            )
        return self

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return an edge."""
        return upright()

    def touchable(self, setting: ObjectSetting) -> Touchable:
        """Return the edge, up to the chamfer."""
        low, high = self.heights(setting)
        return Touchable(low, high - self.chamfer_mm * MILLIMETRE, flank=math.pi / 4)

    def mesh(self, setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Build the block."""
        mm = MILLIMETRE
        return block(self.side_mm * mm, *self.heights(setting), self.chamfer_mm * mm)


def block(side: float, bottom: float, top: float, chamfer: float = 0.0) -> Mesh:
    """Mesh a square block with an upright edge at the origin; its diagonal is along -y.

    The edges of its top have a chamfer of 45 degrees; the upright edge ends below it.
    """
    half = side / np.sqrt(2)
    outline = np.array([[0.0, 0.0], [-half, -half], [0.0, -2 * half], [half, -half]])
    if chamfer:
        middle = outline.mean(axis=0)
        inset = middle + (1 - 2 * chamfer / side) * (outline - middle)
        levels = [(outline, bottom), (outline, top - chamfer), (inset, top)]
        rings = [np.column_stack([points, np.full(4, z)]) for points, z in levels]
        return lofted(np.array(rings))
    return prism(outline, bottom, top)
