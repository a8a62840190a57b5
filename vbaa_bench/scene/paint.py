"""Paints of parts, what each decides, and grime.

A paint is a finish that is registered under its name in `FINISHES`.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Final

from pydantic import Field

from vbaa_bench.geometry.textures import Texture
from vbaa_bench.scene.families import Names
from vbaa_bench.scene.part import Fraction, Part, Positive

# Below, the narrow reflection could not be sampled; above, the surface would lose light between
# its own slopes.
Roughness = Annotated[float, Field(ge=0.1, le=0.6)]

# Reflectance of matt black paint.
_BLACK: Final = 0.03
# Refractive index and extinction coefficient of iron at 550 nm (Johnson and Christy 1974): its
# specular reflectance is 52 %.
_IRON: Final = (2.95, 2.93)
# Mean reflectance of textured bare steel, over that of iron. Chosen.
_TEXTURED_STEEL: Final = 0.8


class Finish(ABC):
    """How a paint reflects light."""

    # Whether it has a specular reflection.
    shines: ClassVar[bool] = False
    # Whether an object that has it may have a texture.
    takes_texture: ClassVar[bool] = True

    def mean(self, reflectance: float) -> float:
        """Return the mean reflectance of a part with this key; a texture varies about it."""
        return reflectance

    def textured(self, texture: Texture) -> Texture:
        """Return the texture of an object as it is under this finish."""
        return texture

    @abstractmethod
    def description(
        self, diffuse: dict[str, Any], specular: dict[str, Any] | None, roughness: float
    ) -> dict[str, Any]:
        """Describe the surface in the keys and values of Mitsuba.

        `diffuse` and `specular` describe the diffuse reflectance and the factor of the specular one
        in the same way; `specular` is None where it is 1. `roughness` is alpha.
        """


class _Matt(Finish):
    def description(
        self, diffuse: dict[str, Any], _specular: dict[str, Any] | None, _roughness: float
    ) -> dict[str, Any]:
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": diffuse}}


class _Black(_Matt):
    takes_texture = False

    def mean(self, _reflectance: float) -> float:
        return _BLACK


class _Gloss(Finish):
    shines = True

    def description(
        self, diffuse: dict[str, Any], specular: dict[str, Any] | None, roughness: float
    ) -> dict[str, Any]:
        plastic = {"type": "roughplastic", "diffuse_reflectance": diffuse, "alpha": roughness}
        return plastic | _factor(specular)


class _Bare(Finish):
    shines = True

    def mean(self, _reflectance: float) -> float:
        return _TEXTURED_STEEL

    def textured(self, texture: Texture) -> Texture:
        # Steel has no diffuse reflectance.
        return replace(texture, gloss=texture.image)

    def description(
        self, _diffuse: dict[str, Any], specular: dict[str, Any] | None, roughness: float
    ) -> dict[str, Any]:
        # The Beckmann distribution has less self-shadowing than others: none up to alpha 0.4.
        steel = {"type": "roughconductor", "distribution": "beckmann", "alpha": roughness}
        eta, k = ({"type": "spectrum", "value": value} for value in _IRON)
        return {"type": "twosided", "bsdf": {**steel, "eta": eta, "k": k, **_factor(specular)}}


def _factor(specular: dict[str, Any] | None) -> dict[str, Any]:
    return {} if specular is None else {"specular_reflectance": specular}


FINISHES: Final = Names[Finish]()
FINISHES.register(matt=_Matt, gloss=_Gloss, bare=_Bare, black=_Black)
Paint = Annotated[str, FINISHES]


class PaintedPart(Part):
    """Part with a paint; its `reflectance` is that of matt and gloss paint.

    Bare steel has the reflectance of iron, and matt black has 0.03.
    """

    paint: Paint = Field(
        default="matt",
        description="Surface: matt paint, painted steel, steel without paint, or matt black.",
    )
    reflectance: Fraction = Field(
        default=0.16, description="Reflectance of matt and gloss paint; others have their own."
    )
    roughness: Roughness = Field(
        default=0.3, description="Roughness alpha of the surface of gloss and bare."
    )

    @property
    def finish(self) -> Finish:
        """How the paint reflects light."""
        return FINISHES[self.paint]()

    @property
    def mean_reflectance(self) -> float:
        """Reflectance about which a texture or grime varies; on bare steel, over that of iron."""
        return self.finish.mean(self.reflectance)


class GrimeSpec(Part):
    """Smudges, dust and uneven gloss along the beam and around it, drawn at random.

    Contrast is the standard deviation of reflectance over its mean. Specks of dust have their own
    reflectance and do not shine. The gloss varies from its full value down by `uneven_gloss` of it.
    """

    smudge_contrast: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.12, description="Standard deviation of reflectance over its mean."
    )
    smudge_mm: Positive = Field(default=12, description="Size of the smudges.")
    dust_pct: Annotated[float, Field(ge=0, le=50)] = Field(
        default=2, description="Share of the surface that specks of dust cover."
    )
    dust_mm: Positive = Field(default=0.15, description="Size of the specks.")
    dust_reflectance: Fraction = Field(
        default=0.45, description="Reflectance of the specks, which do not shine."
    )
    uneven_gloss: Fraction = Field(
        default=0.5, description="Share of the gloss by which it varies, from its full value down."
    )
