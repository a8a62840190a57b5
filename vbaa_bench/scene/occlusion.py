"""What hides the beam from the camera: the keys, and the bodies.

A body is an `Occluder` that is registered under its name in `OCCLUDERS`.
"""

from abc import ABC, abstractmethod
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from solver.instrument.transforms import rigid, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import box, prism, together
from vbaa_bench.scene.families import Names
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Fraction, Positive

# The kind that hides nothing in the image.
REMOVED: Final = "removed"
# Thickness of all bodies.
THICKNESS: Final = 0.2 * MILLIMETRE
# Ratio of the extent of all bars to the width that they hide: half is visible, if there is room.
_BARS_EXTENT_RATIO: Final = 2.0
# Width of a leaf over its size, its largest tilt [rad], and its largest size over the extent of the
# area across the beam.
LEAF_WIDTH: Final = 0.4
MAX_TILT: Final = 15 * DEGREE
_MAX_LEAF_RATIO: Final = 0.5


class Area(NamedTuple):
    """Rectangle above the beam over which a body is spread, in the clamp's frame [m]."""

    x_from: float
    x_to: float
    y_from: float
    y_to: float
    height: float


class Occluder(ABC):
    """A thin opaque body, or several, between the beam and the camera."""

    def spread(self, first: float, last: float, _length: float) -> tuple[float, float]:
        """Return the stretch [m] of a beam over which it is spread to hide a part of that size."""
        return first, last

    @abstractmethod
    def mesh(self, area: Area, share: float, count: int, random: np.random.Generator) -> Mesh:
        """Mesh it over an area, of whose length it hides a `share`; `count` is that of the keys."""


class Opaque(Occluder):
    """A sheet."""

    def mesh(self, area: Area, _share: float, _count: int, _random: np.random.Generator) -> Mesh:
        """Mesh the sheet, whose underside is at the area's height."""
        x_from, x_to, y_from, y_to, height = area
        return box(np.array([x_from, y_from, height]), np.array([x_to, y_to, height + THICKNESS]))


class Bars(Occluder):
    """Bars across the beam, evenly spread, each with half a gap on both sides."""

    def spread(self, first: float, last: float, length: float) -> tuple[float, float]:
        """Return a stretch that is longer by the gaps, if there is room."""
        extent = min(_BARS_EXTENT_RATIO * (last - first), length)
        first = float(np.clip((first + last - extent) / 2, 0.0, length - extent))
        return first, first + extent

    def mesh(self, area: Area, share: float, count: int, random: np.random.Generator) -> Mesh:
        """Mesh the bars along y."""
        extent = area.x_to - area.x_from
        # There is a gap even if they hide the whole area.
        width, pitch = 0.999 * (share * extent / count), extent / count
        starts = area.x_from + pitch * (np.arange(count) + 0.5) - width / 2
        bars = [area._replace(x_from=start, x_to=start + width) for start in starts]
        return together([Opaque().mesh(bar, 1.0, 1, random) for bar in bars])


class Leaves(Occluder):
    """Pointed leaves with random centres in the area."""

    def mesh(self, area: Area, _share: float, count: int, random: np.random.Generator) -> Mesh:
        """Mesh the leaves.

        They have random headings and small tilts: none is deeper below the area than half its size
        times the sine of MAX_TILT, plus half its thickness.
        """
        x_from, x_to, y_from, y_to, height = area
        size = min(3 * (x_to - x_from) / np.sqrt(count), _MAX_LEAF_RATIO * (y_to - y_from))
        t = np.linspace(0, 1, 13)
        along, half_width = size * (t - 0.5), LEAF_WIDTH / 2 * size * np.sin(np.pi * t)
        below = np.column_stack([along, -half_width])[:-1]
        above = np.column_stack([along, half_width])[:0:-1]
        leaf = prism(np.vstack([below, above]), -THICKNESS / 2, THICKNESS / 2)
        leaves = []
        for x, y, heading, azimuth, tilt in random.uniform(
            [x_from, y_from, 0, 0, 0], [x_to, y_to, 2 * np.pi, 2 * np.pi, MAX_TILT], (count, 5)
        ):
            rotation = tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            placed = leaf.copy()
            placed.apply_transform(
                rigid(rotation, np.array([x, y, height])) @ turn_about_z(heading)
            )
            leaves.append(placed)
        return together(leaves)


OCCLUDERS: Final = Names[Occluder](REMOVED)
OCCLUDERS.register(sheet=Opaque, bars=Bars, leaves=Leaves)


class OcclusionSpec(PaintedPart):
    """Occlusions of the beam: every frame is repeated for every kind, place and availability.

    Availability is the paper's AR (eq. 32): the visible fraction of the beam's length.
    The hidden segment begins at the clamp, is about the contact or the middle, or ends at the
    tip. `removed` hides nothing in the image; the solver ignores that segment instead, as in the
    paper. The others are bodies between beam and camera.
    """

    kind: Annotated[tuple[Annotated[str, OCCLUDERS], ...], Field(min_length=1)] = Field(
        description="Bodies between beam and camera, or removed: nothing in the image, but "
        "the solver ignores the segment."
    )
    place: Annotated[
        tuple[Literal["base", "contact", "middle", "tip"], ...], Field(min_length=1)
    ] = Field(
        default=("contact",),
        description="Place of the hidden segment: from the clamp, about the contact or the "
        "middle, or up to the tip.",
    )
    availability: Annotated[
        tuple[Annotated[float, Field(gt=0, le=1)], ...], Field(min_length=1)
    ] = Field(
        default=(0.6,),
        description="The paper's AR (eq. 32): visible fraction of the beam's length.",
    )
    height_mm: Positive = Field(
        default=8, description="Height of the bodies above the beam and the object."
    )
    reflectance: Fraction = Field(default=0.12, description="Reflectance of matt and gloss paint.")
    count: Annotated[int, Field(ge=1, le=200)] = Field(
        default=6,
        description="Number of bars, with gaps between them, or of leaves, at random places.",
    )

    @model_validator(mode="after")
    def _check_bodies(self) -> "OcclusionSpec":
        bodies = set(self.kind) - {REMOVED}
        if len(bodies) > 1:
            allowed = ", ".join(OCCLUDERS.kinds)
            raise ValueError(f"kind is {list(self.kind)}, allowed is removed and one of {allowed}")
        return self

    @property
    def occluder(self) -> Occluder | None:
        """The body in frames whose cover is not `removed`, or None."""
        return next((OCCLUDERS[kind]() for kind in self.kind if kind != REMOVED), None)
