"""Pushes of a scene: one for each point of its grid, or for each of its samples."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.scene.push_spec import PushSpec


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
