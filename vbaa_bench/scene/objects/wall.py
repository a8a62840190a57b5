"""A flat wall beside the beam."""

from typing import Literal

import numpy as np
from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import box
from vbaa_bench.mechanics.surfaces import Flat
from vbaa_bench.scene.objects.object import ObjectSetting, Touchable, UprightKind
from vbaa_bench.scene.part import Positive


class WallSpec(UprightKind):
    """A flat wall beside the beam, `gap_mm` from it and parallel to it at the angle of contact.

    The beam touches it from the tip inwards and lifts off at 3 gap / dtheta (Fig. 5).
    """

    kind: Literal["wall"]
    gap_mm: Positive = Field(description="Distance of the wall from the side of the beam.")
    length_mm: Positive = Field(default=300, description="Length of the wall along the beam.")
    thickness_mm: Positive = Field(default=5, description="Thickness of the wall.")

    def surface(self, _setting: ObjectSetting) -> Flat:
        """Return a plane."""
        return Flat()

    def gap(self) -> float:
        """Return the distance of the wall."""
        return self.gap_mm * MILLIMETRE

    def touchable(self, setting: ObjectSetting) -> Touchable:
        """Return the face of the wall."""
        low, high = self.heights(setting)
        return Touchable(low, high, half_width=self.length_mm * MILLIMETRE / 2)

    def mesh(self, setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Build the wall."""
        mm = MILLIMETRE
        return wall(self.length_mm * mm, self.thickness_mm * mm, *self.heights(setting))


def wall(width: float, thickness: float, bottom: float, top: float) -> Mesh:
    """Mesh a flat slab whose face is in y = 0 and is centred in x."""
    half = width / 2
    return box(np.array([-half, -thickness, bottom]), np.array([half, 0.0, top]))
