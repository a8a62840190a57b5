"""An image on a surface."""

from typing import Literal

from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.textures import Texture, image_texture
from vbaa_bench.scene.files import ImageName
from vbaa_bench.scene.part import Positive
from vbaa_bench.scene.textures.texture import TextureKind, TextureSetting


class ImageTextureSpec(TextureKind):
    """An image beside the scene: a PNG or JPEG, or OpenEXR file in the scene's folder or below.

    It is repeated, `width_mm` wide. Its mean is the part's `reflectance`; gray values of PNG and
    JPEG are decoded by the curve of sRGB.
    """

    kind: Literal["image"]
    file: ImageName = Field(description="PNG, JPEG or OpenEXR file in the scene's folder.")
    width_mm: Positive = Field(default=50, description="Width of the image on the surface.")

    def texture(self, setting: TextureSetting) -> Texture:
        """Repeat the image."""
        image = setting.files.image(self.file)
        return image_texture(setting.places, image, setting.mean, self.width_mm * MILLIMETRE)
