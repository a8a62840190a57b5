"""Pushes of a scene: the keys of their grid, and one push for each point of it or each sample."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.scene.part import ONSET, Onset, Part, Positive, Tilt, check_order

# Chosen: two days of rendering, a terabyte with all layers.
MAX_FRAMES: Final = 1_000_000

Angle = Annotated[float, Field(gt=-60, lt=60)]
Deflection = Annotated[float, Field(gt=0, lt=60)]


class PushSpec(Part):
    """Grid of pushes: contact distances x normals x stiffnesses x repeats, step after step.

    Contact distance is that of the first contact, on the beam at rest; deflection is the tip's
    displacement across the beam, over L. The deflections, or pushing angles, are the steps of one
    push in their order; a step whose angle is not positive is before contact.
    """

    contact_distance_mm: Annotated[tuple[Positive, ...], Field(min_length=1)] | None = Field(
        default=None,
        description="Contact distances, along the beam at rest; not needed for a wall or "
        "without an object.",
    )
    deflection_pct: tuple[Deflection, ...] | None = Field(
        default=None,
        description="Steps of a push, as the tip's displacement across the beam over the length.",
    )
    pushing_angle_deg: tuple[Angle, ...] | None = Field(
        default=None,
        description="Steps of a push, as the motor's rotation since first contact; before "
        "contact, it is not positive.",
    )
    normal_deg: Annotated[tuple[Tilt, ...], Field(min_length=1)] = Field(
        default=(0.0,), description="Tilts nu of the touched edge's normal out of plane C."
    )
    stiffness_n_m: Annotated[tuple[Positive | Literal["rigid"], ...], Field(min_length=1)] = Field(
        default=("rigid",), description="Stiffnesses of the object along its normal, or rigid."
    )
    repeats: Annotated[int, Field(ge=1, le=MAX_FRAMES)] = Field(
        default=1,
        description="Number of pushes at each point of the grid. Each has its own noise, motor "
        "angle at contact, and draws of keys that are random per push.",
    )
    motor_angle_at_contact_deg: Onset = Field(
        default=ONSET,
        description="Range from which the motor's angle at first contact is drawn for every "
        "push; equal ends fix it. Of a push with one step, it is the angle of that step, to a "
        "few tenths of a degree: otherwise the encoder would reveal the pushing angle, which "
        "depends on the contact.",
    )

    @model_validator(mode="after")
    def _check_onset(self) -> "PushSpec":
        check_order("motor_angle_at_contact_deg", self.motor_angle_at_contact_deg)
        return self

    @model_validator(mode="after")
    def _check_steps(self) -> "PushSpec":
        if (self.deflection_pct is None) == (self.pushing_angle_deg is None):
            raise ValueError("exactly one of deflection_pct and pushing_angle_deg must be given")
        if not (self.deflection_pct or self.pushing_angle_deg):
            raise ValueError("the list of deflections or pushing angles is empty")
        return self


@dataclass(frozen=True)
class StepTarget:
    """Target of one step of a push: a tip deflection or a pushing angle.

    `deflection` is the tip's displacement across the beam over its length; `pushing_angle` [rad]
    is the motor's rotation. One of the two is None.
    """

    deflection: float | None
    pushing_angle: float | None

    def __str__(self) -> str:
        """Format the target for a plot's legend."""
        if self.deflection is not None:
            return f"{self.deflection / PERCENT:.6g} %"
        return f"{(self.pushing_angle or 0.0) / DEGREE:.6g}°"


@dataclass(frozen=True)
class Push:
    """One push: first contact, then a sequence of targets.

    First contact is at `contact_distance` [m] (None against a wall), with an object whose normal
    is tilted by `normal` [rad] and which yields by `compliance` [m/N]. All, with `gravity` (3,)
    [m/s^2], is in the frame of the antenna at first contact.
    """

    contact_distance: float | None
    normal: float
    compliance: float
    targets: tuple[StepTarget, ...]
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)


def grid_size(spec: PushSpec) -> int:
    """Count the pushes of a grid."""
    return math.prod(map(len, _axes(spec)))


def grid_push(spec: PushSpec, row: int) -> Push:
    """Return the push in one row of the grid, whose last axis changes fastest."""
    values = []
    for axis in reversed(_axes(spec)):
        row, i = divmod(row, len(axis))
        values.append(axis[i])
    stiffness, normal, distance = values
    return Push(
        None if distance is None else distance * MILLIMETRE,
        normal * DEGREE,
        0.0 if stiffness == "rigid" else 1 / stiffness,
        targets(spec),
    )


def sampled_push(sample: Mapping[str, float]) -> Push:
    """Convert the values of one sample, in the units of a scene's keys, to a push."""
    return Push(
        sample["contact_distance_mm"] * MILLIMETRE,
        sample["normal_deg"] * DEGREE,
        1 / sample["stiffness_n_m"] if "stiffness_n_m" in sample else 0.0,
        (StepTarget(sample["deflection_pct"] * PERCENT, None),),
    )


def targets(spec: PushSpec) -> tuple[StepTarget, ...]:
    """List the targets of a push of a grid, in the order of its steps."""
    return (
        *(StepTarget(percent * PERCENT, None) for percent in spec.deflection_pct or ()),
        *(StepTarget(None, degrees * DEGREE) for degrees in spec.pushing_angle_deg or ()),
    )


def _axes(spec: PushSpec) -> tuple[Sequence[Any], ...]:
    """Return the axes of the grid: contact distances, normals and stiffnesses."""
    return spec.contact_distance_mm or (None,), spec.normal_deg, spec.stiffness_n_m


def expected_pushing_angle(push: Push, length: float) -> float:
    """Approximate the pushing angle [rad] of the only step of a push, without solving it.

    This follows from the linear beam, (9) and (10) of Kaneko et al. (2001): an edge at x_c holds it
    back by dtheta x_c, which displaces the tip by dtheta (3 L - x_c) / 2. With the sine of dtheta
    it agrees with the exact beam to 0.05 degrees at deflections of up to 20 % of the length, and
    to 0.5 degrees at 45 %. A tilted edge holds the beam back along its normal only. A wall is
    touched by the tip.
    """
    (target,) = push.targets
    if target.pushing_angle is not None:
        return target.pushing_angle
    assert target.deflection is not None
    contact = 1.0 if push.contact_distance is None else push.contact_distance / length
    in_its_plane = math.asin(min(2 * target.deflection / (3 - contact), 1.0))
    return in_its_plane / math.cos(push.normal)
