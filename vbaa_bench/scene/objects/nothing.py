"""No object."""

from typing import ClassVar, Literal

from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.object import ObjectKind, ObjectSetting


class NothingSpec(ObjectKind):
    """No object at all: the beam in free space."""

    present: ClassVar[bool] = False

    kind: Literal["none"]

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return an edge, which is never reached."""
        return upright()

    def mesh(self, _setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Raise ValueError."""
        raise ValueError("no mesh to build")
