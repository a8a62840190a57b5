"""A weight that hangs from the beam by a thread: a load in place of an object."""

from collections.abc import Sequence
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from solver.instrument.units import GRAM, MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import rod, together
from vbaa_bench.geometry.tube import tube
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.object import ObjectKind, ObjectSetting
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Positive, Triple

# Sides of the thread, and segments of its loop around the beam.
_THREAD_SIDES: Final = 12
_LOOP_SEGMENTS: Final = 96


class WeightSpec(PaintedPart, ObjectKind):
    """A weight on a thread whose loop is around the beam, at the contact distance along it.

    It pulls with its mass times `gravity_m_s2`, in all steps of a push: a step's pushing angle is
    the motor's rotation since the weight was hung. The sizes of thread and weight are for the image
    only. They do not depend on the mass, which the image would otherwise reveal.
    """

    kind: Literal["weight"]
    weight_g: Annotated[float, Field(gt=0, le=1e6)] = Field(
        default=50, description="Mass of the weight."
    )
    thread_diameter_mm: Positive = Field(default=0.3, description="Diameter of the thread.")
    thread_length_mm: Positive = Field(
        default=25, description="Length of the thread from the beam's axis to the weight."
    )
    weight_diameter_mm: Positive = Field(default=12, description="Diameter of the weight.")
    weight_height_mm: Positive = Field(default=14, description="Height of the weight.")

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return an edge: nothing is touched."""
        return upright()

    def mass(self) -> float:
        """Return the mass."""
        return self.weight_g * GRAM

    def mesh(self, setting: ObjectSetting, _give: float = 0.0, slope: float = 0.0) -> Mesh:
        """Build the loop, the thread and the weight."""
        mm = MILLIMETRE
        return weight(
            setting.beam_radius,
            slope,
            self.thread_diameter_mm * mm / 2,
            self.thread_length_mm * mm,
            self.weight_diameter_mm * mm / 2,
            self.weight_height_mm * mm,
        )


def weight(
    beam_radius: float,
    slope: float,
    thread_radius: float,
    thread_length: float,
    radius: float,
    height: float,
) -> Mesh:
    """Mesh a loop around the beam, a thread down from it, and a cylinder; all lengths are [m].

    The beam's axis passes through the origin, in the x-y plane, with the given slope against x;
    -y is down. The three bodies overlap where they meet.
    """
    turn = np.linspace(0, 2 * np.pi, _LOOP_SEGMENTS + 1)[:, None]
    across = np.array([-slope, 1.0, 0.0]) / np.hypot(1.0, slope)
    side = np.array([0.0, 0.0, 1.0])
    around = (beam_radius + thread_radius) * (np.cos(turn) * across + np.sin(turn) * side)
    # Below the sloping beam, within the loop.
    top = np.array([0.0, -beam_radius * np.hypot(1.0, slope) - thread_radius * abs(slope), 0.0])
    end = np.array([0.0, -thread_length, 0.0])
    return together(
        [
            tube(around, thread_radius, _THREAD_SIDES),
            tube(np.array([top, end]), thread_radius, _THREAD_SIDES),
            rod(end, end - [0.0, height, 0.0], radius),
        ]
    )


def weight_mistake(
    gravity: Triple, deflections: object, normals: Sequence[float], unsupported: Sequence[str]
) -> str | None:
    """Describe what a scene with a hung weight must not have; None if it is possible.

    `deflections` are the requested ones, if any, `normals` the tilts of the object in degrees, and
    `unsupported` the names of the scene's parts that are not modelled together with a weight.
    """
    if not any(gravity):
        return "object.kind is weight and gravity_m_s2 is zero, allowed is any other gravity"
    if deflections is not None:
        return "a weight needs pushing_angle_deg: its deflection follows from weight_g"
    if any(normals):
        return f"normal_deg is {list(normals)}, allowed is 0 for a weight, which hangs"
    if unsupported:
        return f"object.kind is weight and {unsupported[0]} is given, allowed is one of them"
    return None
