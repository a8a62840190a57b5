"""Lights for the renderer. Positions are in Sigma_a, in metres.

Only the ratios between lights matter, because the camera's exposure is metered on the beam.
Radiance and irradiance are therefore in one arbitrary unit.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.sheets import irradiance


class Emitter(ABC):
    """One emitter of Mitsuba, which a point of the unit square samples smoothly."""

    @property
    def sheet(self) -> "Lamp | None":
        """The luminous sheet, which hides what is behind it; None for a light without one."""
        return None

    @abstractmethod
    def extent(self) -> Floats | None:
        """Return points (n, 3) whose hull contains the light; None if it is infinitely far."""

    @abstractmethod
    def description(self, render_from_antenna: Floats) -> dict[str, Any]:
        """Describe the emitter in the keys and values of Mitsuba.

        `render_from_antenna` (4, 4) is a uniform scale and a shift. Poses are arrays (4, 4) here,
        images arrays (height, width, 1) of single precision. A sheet describes its radiance; the
        renderer adds its mesh.
        """

    def with_ambient(self, _radiance: float) -> "Emitter | None":
        """Return light from all around with more radiance; None for any other light."""
        return None


@dataclass(frozen=True)
class Lamp(Emitter):
    """A sheet that emits a uniform `radiance` from its front side."""

    mesh: Mesh
    radiance: float = 1.0

    @classmethod
    def of_irradiance(cls, mesh: Mesh, aim: Floats, of_aim: float) -> "Lamp":
        """Return a lamp with the irradiance `of_aim` on a sheet at `aim` (3,) that faces it."""
        towards = np.asarray(mesh.vertices).mean(axis=0) - aim
        return cls(mesh, of_aim / irradiance(mesh, aim, towards / np.linalg.norm(towards)))

    @property
    def sheet(self) -> "Lamp":
        """The lamp itself."""
        return self

    def extent(self) -> Floats:
        """Return the corners of the mesh."""
        return np.asarray(self.mesh.vertices)

    def description(self, _render_from_antenna: Floats) -> dict[str, Any]:
        """Describe the light of the sheet, without its mesh."""
        return {"type": "area", "radiance": {"type": "rgb", "value": self.radiance}}


def pose_towards(position: Floats, aim: Floats, along: Floats) -> Floats:
    """Compute world_from_emitter (4, 4): +z towards the aim, the slide's rows along `along`."""
    ahead = (aim - position) / np.linalg.norm(aim - position)
    across = along - (along @ ahead) * ahead
    # Mitsuba's x points to the left when looking along +z.
    left = -across / np.linalg.norm(across)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([left, np.cross(ahead, left), ahead])
    pose[:3, 3] = position
    return pose
