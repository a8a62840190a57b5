"""Kinds of object, one module each. `docs/kinds.md` shows how to write one."""

from vbaa_bench.scene.objects.block import BlockSpec
from vbaa_bench.scene.objects.cylinder import CylinderSpec
from vbaa_bench.scene.objects.knife_edge import KnifeEdgeSpec
from vbaa_bench.scene.objects.mesh import MeshSpec
from vbaa_bench.scene.objects.nothing import NothingSpec
from vbaa_bench.scene.objects.object import OBJECTS
from vbaa_bench.scene.objects.pad import PadSpec
from vbaa_bench.scene.objects.peg import PegSpec
from vbaa_bench.scene.objects.plunger import PlungerSpec
from vbaa_bench.scene.objects.sphere import SphereSpec
from vbaa_bench.scene.objects.wall import WallSpec
from vbaa_bench.scene.objects.weight import WeightSpec

# In the order in which messages list them.
OBJECTS.register(
    BlockSpec,
    CylinderSpec,
    PegSpec,
    SphereSpec,
    KnifeEdgeSpec,
    WallSpec,
    PlungerSpec,
    PadSpec,
    MeshSpec,
    WeightSpec,
    NothingSpec,
)
