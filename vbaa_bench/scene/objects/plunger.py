"""A nose on a coil spring."""

from typing import ClassVar, Final, Literal

import numpy as np
from pydantic import Field

from solver.instrument.errors import InputError
from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import arc, box, prism, rod, side_count, together
from vbaa_bench.geometry.tube import tube
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.object import ObjectSetting, UprightKind
from vbaa_bench.scene.part import Below, NonNegative, Positive

# Turns of the spring.
TURNS: Final = 6


class PlungerSpec(UprightKind):
    """A nose on a coil spring: the tiny spring-based force measure of Fig. 11."""

    deforms: ClassVar[bool] = True
    linear: ClassVar[bool] = True

    kind: Literal["plunger"]
    top_mm: NonNegative = Field(default=1.5, description="Height of the top above plane C.")
    bottom_mm: Below | None = Field(
        default=-4, description="Height of the bottom; null: it stands on the background."
    )
    nose_radius_mm: Positive = Field(default=2, description="Radius of the nose.")
    free_length_mm: Positive = Field(
        default=25, description="Length of the spring when nothing presses it."
    )

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return the side of the nose."""
        return upright(self.nose_radius_mm * MILLIMETRE)

    def mesh(self, setting: ObjectSetting, give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Build the plunger, pressed in by `give`. Raises InputError if its turns would touch."""
        mm, heights = MILLIMETRE, self.heights(setting)
        return plunger(self.nose_radius_mm * mm, give, self.free_length_mm * mm, *heights)


def plunger(
    nose_radius: float, compression: float, free_length: float, bottom: float, top: float
) -> Mesh:
    """Mesh a sprung nose: half an upright cylinder on a stem, with a coil spring and a housing.

    The coil is between nose and housing. The nose stays at the origin; `compression` moves the
    housing nearer, whose front is at y = -nose_radius - (free_length - compression). The mesh
    has four closed bodies, one of which, the stem, reaches into two others. Raises InputError if
    the coil's turns would touch.
    """
    girth = min(nose_radius, (top - bottom) / 2)
    wire = min(0.12 * girth, free_length / (8 * TURNS))
    shortest = 2 * wire * TURNS
    if not 0 <= compression <= free_length - shortest:
        raise InputError(
            f"the plunger is pressed in by {compression / MILLIMETRE:g} mm,"
            f" allowed is 0 to {(free_length - shortest) / MILLIMETRE:g} mm"
        )
    middle, shoulder = (bottom + top) / 2, -nose_radius
    front = shoulder - free_length + compression
    # At every compression the stem stays in its bore, and the bore is deep enough for it.
    stem_end, depth = shoulder - 1.1 * free_length, 1.2 * free_length
    n = side_count(nose_radius)
    nose = prism(arc(nose_radius, np.pi * (np.arange(n + 1) / n - 0.5)), bottom, top)
    stem = rod(
        np.array([0.0, shoulder / 2, middle]), np.array([0.0, stem_end, middle]), 0.4 * girth
    )
    fraction = np.linspace(0, 1, 32 * TURNS + 1)
    turn = 2 * np.pi * TURNS * fraction
    coil_radius = 0.7 * girth
    helix = np.column_stack(
        [
            coil_radius * np.sin(turn),
            shoulder + (front - shoulder) * fraction,
            middle + coil_radius * np.cos(turn),
        ]
    )
    housing = box(
        np.array([-nose_radius, front - depth, bottom]), np.array([nose_radius, front, top])
    )
    return together([nose, stem, tube(helix, wire, 12), housing])
