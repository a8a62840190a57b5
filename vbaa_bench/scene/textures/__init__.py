"""Kinds of texture, one module each. `docs/kinds.md` shows how to write one."""

from vbaa_bench.scene.textures.brushed import BrushedTextureSpec
from vbaa_bench.scene.textures.image import ImageTextureSpec
from vbaa_bench.scene.textures.speckle import SpeckleTextureSpec
from vbaa_bench.scene.textures.texture import TEXTURES

# In the order in which messages list them.
TEXTURES.register(ImageTextureSpec, BrushedTextureSpec, SpeckleTextureSpec)
