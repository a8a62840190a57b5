"""What a module with kinds of your own needs; `docs/kinds.md` shows how to write one."""

from vbaa_bench.geometry.mesh import mesh_of
from vbaa_bench.geometry.sheets import annulus, rectangle
from vbaa_bench.geometry.solids import box, lofted, prism, rod, together
from vbaa_bench.geometry.textures import (
    Texture,
    gradient_texture,
    image_texture,
    random_texture,
)
from vbaa_bench.mechanics.surfaces import Solid, ball, upright
from vbaa_bench.scene.background import GROUNDS, GroundKind, GroundSetting, Sheet
from vbaa_bench.scene.files import EnvironmentName, ImageFiles, ImageName, MeshName
from vbaa_bench.scene.lights.emitter import Emitter, Lamp, pose_towards
from vbaa_bench.scene.lights.light import LIGHTS, AimedKind, LightKind, LightSetting, metres
from vbaa_bench.scene.lights.sight import NO_SHADING, Sight, Tangent
from vbaa_bench.scene.objects.object import (
    OBJECTS,
    ObjectKind,
    ObjectSetting,
    Touchable,
    TouchedKind,
    UprightKind,
)
from vbaa_bench.scene.occlusion import OCCLUDERS, Area, Occluder
from vbaa_bench.scene.paint import FINISHES, Finish
from vbaa_bench.scene.part import Coordinate, Fraction, NonNegative, Positive, Triple, Turn
from vbaa_bench.scene.textures.texture import TEXTURES, TextureKind, TextureSetting

__all__ = [
    "FINISHES",
    "GROUNDS",
    "LIGHTS",
    "NO_SHADING",
    "OBJECTS",
    "OCCLUDERS",
    "TEXTURES",
    "AimedKind",
    "Area",
    "Coordinate",
    "Emitter",
    "EnvironmentName",
    "Finish",
    "Fraction",
    "GroundKind",
    "GroundSetting",
    "ImageFiles",
    "ImageName",
    "Lamp",
    "LightKind",
    "LightSetting",
    "MeshName",
    "NonNegative",
    "ObjectKind",
    "ObjectSetting",
    "Occluder",
    "Positive",
    "Sheet",
    "Sight",
    "Solid",
    "Tangent",
    "Texture",
    "TextureKind",
    "TextureSetting",
    "Touchable",
    "TouchedKind",
    "Triple",
    "Turn",
    "UprightKind",
    "annulus",
    "ball",
    "box",
    "gradient_texture",
    "image_texture",
    "lofted",
    "mesh_of",
    "metres",
    "pose_towards",
    "prism",
    "random_texture",
    "rectangle",
    "rod",
    "together",
    "upright",
]
