"""Base of the kinds of texture: keys, and reflectances. `docs/kinds.md` has an example."""

from abc import ABC, abstractmethod
from typing import Annotated, Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.textures import Texture
from vbaa_bench.scene.families import Family
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.part import Part


class TextureSetting(NamedTuple):
    """What a texture refers to: the `places` (n, 2) [m] of a part's vertices on its sides.

    `extent` [m] is the largest distance of two places along an axis. The texture has the `mean`
    reflectance, and its pattern is drawn from `random`.
    """

    places: Floats
    mean: float
    extent: float
    files: ImageFiles
    random: np.random.Generator


class TextureKind(Part, ABC):
    """Texture of the sides of an object."""

    kind: str

    @abstractmethod
    def texture(self, setting: TextureSetting) -> Texture:
        """Create the reflectances. Raises SceneFileError for a file that cannot be used."""


TEXTURES: Final[Family[TextureKind]] = Family()
AnyTexture = Annotated[TextureKind, TEXTURES]
