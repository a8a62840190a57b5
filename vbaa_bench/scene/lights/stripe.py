"""Projector of a bright stripe."""

from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply
from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.sheets import axes
from vbaa_bench.scene.files import ImageFiles
from vbaa_bench.scene.lights.emitter import Emitter, pose_towards
from vbaa_bench.scene.lights.light import ALONG, AimedKind, LightSetting
from vbaa_bench.scene.part import Positive, Triple

# Pixels of the stripe's slide across the width of a blurred edge.
EDGE_PX: Final = 8


@dataclass(frozen=True)
class Projector(Emitter):
    """A point source that projects a slide, the `image` (height, width) of transmittances.

    On a sheet at `aim` (3,) that faces the projector, the slide is `width` [m] wide and its rows
    run along `along` (3,).
    """

    position: Floats
    aim: Floats
    along: Floats
    width: float
    image: Floats
    irradiance: float

    def extent(self) -> Floats:
        """Return the position."""
        return self.position[None]

    def description(self, render_from_antenna: Floats) -> dict[str, Any]:
        """Describe Mitsuba's projector."""
        position, aim = apply(render_from_antenna, np.array([self.position, self.aim]))
        distance = float(np.linalg.norm(self.aim - self.position))
        render_distance = float(np.linalg.norm(aim - position))
        image = np.ascontiguousarray(self.image[:, :, None], dtype=np.float32)
        return {
            "type": "projector",
            # Mitsuba's factor: irradiance at the distance z is pi scale / z^2.
            "irradiance": {"type": "bitmap", "bitmap": image, "raw": True, "wrap_mode": "clamp"},
            "scale": self.irradiance * render_distance**2 / np.pi,
            "fov": float(np.rad2deg(2 * np.arctan2(self.width / 2, distance))),
            "fov_axis": "x",
            "to_world": pose_towards(position, aim, self.along),
        }


class _Slide(NamedTuple):
    """A slide's width [m] at the aim, and its image (height, width), 1 in the stripe."""

    width: float
    image: Floats


class StripeSpec(AimedKind):
    """Projector of a bright stripe along the beam: the paper's artificial light.

    Length and width are those at the aim, across the light; the edges fade over `edge_width_mm`.
    """

    kind: Literal["stripe"]
    position_mm: Triple = Field(
        default=(120.0, -200.0, 350.0), description="Position of the projector."
    )
    length_mm: Positive = Field(default=280, description="Length of the stripe at the aim.")
    width_mm: Positive = Field(default=90, description="Width of the stripe at the aim.")
    edge_width_mm: Positive = Field(
        default=4,
        description="Width of the rim over which the light fades, at least 1/200 of width_mm.",
    )

    @model_validator(mode="after")
    def _check_edge_width(self) -> "StripeSpec":
        if self.edge_width_mm < self.width_mm / 200:
            raise ValueError(
                f"edge_width_mm is {self.edge_width_mm:g}, allowed is >= 1/200 of width_mm, "
                f"{self.width_mm:g}"
            )
        return self

    def emitter(self, setting: LightSetting, _files: ImageFiles) -> Projector:
        """Build the projector, its slide's rows as parallel to the beam as possible."""
        position, aim = self.ends(setting)
        slide, along = self._slide(), axes(aim - position, ALONG)[0]
        return Projector(position, aim, along, slide.width, slide.image, self.irradiance)

    def _slide(self) -> _Slide:
        pixel = self.edge_width_mm / EDGE_PX
        sides = []
        for size in (self.length_mm, self.width_mm):
            count = int(np.ceil((size + 2 * self.edge_width_mm) / pixel))
            positions = (np.arange(count) - (count - 1) / 2) * pixel
            # Half a sine wave from light to dark, similar to an edge slightly out of focus.
            edge = np.clip((np.abs(positions) - size / 2) / self.edge_width_mm, -0.5, 0.5)
            sides.append(0.5 - 0.5 * np.sin(np.pi * edge))
        along, across = sides
        return _Slide(len(along) * pixel * MILLIMETRE, np.outer(across, along))
