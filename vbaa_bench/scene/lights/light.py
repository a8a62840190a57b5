"""Base of the kinds of light: keys, and what follows from them. `docs/kinds.md` has an example."""

from abc import ABC, abstractmethod
from typing import Annotated, ClassVar, Final, NamedTuple

import numpy as np
from pydantic import Field

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE
from vbaa_bench.scene.families import Family
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.lights.emitter import Emitter
from vbaa_bench.scene.lights.sight import Sight, Tangent
from vbaa_bench.scene.part import Part, Positive, Triple

Sides = tuple[Positive, Positive]
ALONG: Final = np.array([1.0, 0.0, 0.0])
UP: Final = np.array([0.0, 0.0, 1.0])


class LightSetting(NamedTuple):
    """What the places of lights may refer to, in the frame in which the camera is fixed.

    `ground_mm` is the distance of the background below plane C.
    """

    camera_mm: Triple
    look_at_mm: Triple
    ground_mm: float

    @property
    def camera(self) -> Floats:
        """Position of the camera (3,) [m]."""
        return metres(self.camera_mm)

    @property
    def look_at(self) -> Floats:
        """Point at which the camera looks (3,) [m]."""
        return metres(self.look_at_mm)


class LightKind(Part, ABC):
    """One of several lights, fixed to the same frame as the camera and aimed at its look-at."""

    irradiance: Positive = Field(
        default=1.0,
        description="Irradiance at the aim, of a sheet that faces the light. Only ratios between "
        "lights matter, because the exposure is metered on the beam.",
    )
    kind: str
    # Whether it is all around the scene. Mitsuba allows one such light.
    surrounds: ClassVar[bool] = False

    @abstractmethod
    def emitter(self, setting: LightSetting, files: ImageFiles) -> Emitter:
        """Build the light for the renderer. Raises SceneFileError for a file it cannot use."""

    @abstractmethod
    def tangent(self, setting: LightSetting, sight: Sight) -> Tangent:
        """Compute the direction of the light, as far as a laboratory can measure it."""

    def mistake(self, _setting: LightSetting) -> str | None:
        """Describe what is impossible in a scene with this setting; None if nothing is."""
        return None

    def panel_mm(self, _setting: LightSetting) -> float | None:
        """Return the height [mm] above plane C of a panel behind the beam; None for other lights.

        It is off while a calibration board is in front of it.
        """
        return None


class AimedKind(LightKind):
    """A light at a place, with an aim."""

    position_mm: Triple = Field(description="Position of the light.")
    aim_mm: Triple | None = Field(
        default=None,
        description="Point at which the light is aimed, by default that at which the camera looks.",
    )

    def mistake(self, setting: LightSetting) -> str | None:
        """Describe a light at its own aim."""
        aim = self.aim_mm or setting.look_at_mm
        if self.position_mm != aim:
            return None
        return (
            f"position_mm is equal to the aim, {list(aim)}, for one of kind {self.kind}; allowed "
            "is any other position"
        )

    def ends(self, setting: LightSetting) -> tuple[Floats, Floats]:
        """Return position and aim (3,), (3,) [m]."""
        aim = setting.look_at_mm if self.aim_mm is None else self.aim_mm
        return metres(self.position_mm), metres(aim)

    def tangent(self, _setting: LightSetting, sight: Sight) -> Tangent:
        """Compute the direction to the position of the light."""
        return sight.to(np.array(self.position_mm), 0.0)


def metres(position: tuple[float, ...]) -> Floats:
    """Convert a position or sizes from millimetres."""
    return np.array(position) * MILLIMETRE


LIGHTS: Final[Family[LightKind]] = Family()
AnyLight = Annotated[LightKind, LIGHTS]
