"""Kinds of light, one module each. `docs/kinds.md` shows how to write one."""

from vbaa_bench.scene.lights.area import AreaSpec
from vbaa_bench.scene.lights.back import BackSpec
from vbaa_bench.scene.lights.environment import EnvironmentSpec
from vbaa_bench.scene.lights.light import LIGHTS
from vbaa_bench.scene.lights.ring import RingSpec
from vbaa_bench.scene.lights.side import SideSpec
from vbaa_bench.scene.lights.spot import SpotSpec
from vbaa_bench.scene.lights.stripe import StripeSpec

# In the order in which messages list them.
LIGHTS.register(AreaSpec, SideSpec, RingSpec, BackSpec, StripeSpec, SpotSpec, EnvironmentSpec)
