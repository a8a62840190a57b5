"""A weight that hangs from the beam by a thread: a load in place of an object."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Positive, Triple


class WeightSpec(PaintedPart):
    """A weight on a thread whose loop is around the beam, at the contact distance along it.

    It pulls with its mass times `gravity_m_s2`, in all steps of a push: a step's pushing angle is
    the motor's rotation since the weight was hung. The sizes of thread and weight are for the image
    only. They do not depend on the mass, which the image would otherwise reveal.
    """

    kind: Literal["weight"]
    weight_g: Annotated[float, Field(gt=0, le=1e6)] = 50
    thread_diameter_mm: Positive = 0.3
    thread_length_mm: Positive = 25
    weight_diameter_mm: Positive = 12
    weight_height_mm: Positive = 14


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
