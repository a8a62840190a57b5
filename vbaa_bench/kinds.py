"""What a module with kinds of your own needs; `docs/kinds.md` shows how to write one."""

from vbaa_bench.geometry.sheets import annulus, rectangle
from vbaa_bench.scene.files import EnvironmentName, ImageName
from vbaa_bench.scene.lights.emitter import Emitter, Lamp, pose_towards
from vbaa_bench.scene.lights.light import LIGHTS, AimedKind, Files, LightKind, Setting, metres
from vbaa_bench.scene.lights.sight import NO_SHADING, Sight, Tangent
from vbaa_bench.scene.part import Coordinate, Fraction, NonNegative, Positive, Triple, Turn

__all__ = [
    "LIGHTS",
    "NO_SHADING",
    "AimedKind",
    "Coordinate",
    "Emitter",
    "EnvironmentName",
    "Files",
    "Fraction",
    "ImageName",
    "Lamp",
    "LightKind",
    "NonNegative",
    "Positive",
    "Setting",
    "Sight",
    "Tangent",
    "Triple",
    "Turn",
    "annulus",
    "metres",
    "pose_towards",
    "rectangle",
]
