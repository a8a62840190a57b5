"""Equations of a contact between a rod and an object in the world."""

from dataclasses import dataclass, field

import numpy as np

from solver.instrument.arrays import Floats, freeze
from vbaa_bench.mechanics.rod import Rod, cross
from vbaa_bench.mechanics.surfaces import Surface


@dataclass(frozen=True)
class Obstacle:
    """Object that the beam may touch; the world's frame is the clamp's at first contact.

    `world_from_object` (4, 4) is its pose. It yields along the direction `spring` (3,) by
    `compliance` [m/N]; `friction` is Coulomb's coefficient. A beam of rectangular section is
    touched on its face, across the whole width.
    """

    surface: Surface
    world_from_object: Floats
    compliance: float = 0.0
    spring: Floats = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))
    friction: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, "world_from_object", (4, 4))
        freeze(self, "spring", (3,))


@dataclass(frozen=True)
class PreviousContact:
    """Contact in the previous step, as friction in the current step needs it.

    `s` is its arc length [m] and `point` (3,) [m] the touched point in the object's frame. With
    `sticks`, the contact is held there in the current step, too. `slid` (3,) [m] is its sliding
    displacement in the previous step, `pace` that step's size (angle [rad] or deflection), and
    `ratio` the current step's size over `pace`, or zero at the start of a path. `drag` (3,), if
    given, is the direction of the friction force in the clamp's frame, whatever the sliding.
    """

    s: float
    point: Floats
    slid: Floats = field(default_factory=lambda: np.zeros(3))
    pace: float = 1.0
    ratio: float = 0.0
    sticks: bool = False
    drag: Floats | None = None

    @property
    def lag(self) -> Floats:
        """Part (3,) [m] to subtract from the displacement to get the current sliding direction.

        It is from the backward difference of order 2 for uneven steps (Gear 1971).
        """
        return self.slid * (self.ratio**2 / (1 + 2 * self.ratio))


@dataclass(frozen=True)
class Touch:
    """Residuals and geometry of a contact at trial values.

    `errors` (4,) are zero for a contact: distance, closest point, and two of direction. `lever`
    (3,) [m] points from the centreline to the touched point, `point` (3,) [m] is that point in
    the object's frame, `shift` (3,) [m] is the object's displacement by its compliance, and
    `slope` is the ratio of tangential to normal force.
    """

    errors: Floats
    normal: Floats
    lever: Floats
    point: Floats
    shift: Floats
    slope: float


def touch(
    rod: Rod,
    obstacle: Obstacle,
    clamp_from_world: Floats,
    section: Floats,
    s: float,
    force: Floats,
    previous: PreviousContact | None,
) -> Touch:
    """Evaluate a contact at arc length `s` [m], with `force` (3,) [N] on the beam.

    `section` (12,) is the rod's state there, its position in metres. Errors are in units of the
    beam's length and of the force.
    """
    turn = clamp_from_world[:3, :3]
    spring = turn @ obstacle.spring
    shift = -obstacle.compliance * (force @ spring) * spring
    axes = turn @ obstacle.world_from_object[:3, :3]  # clamp_from_object
    origin = turn @ obstacle.world_from_object[:3, 3] + clamp_from_world[:3, 3] + shift
    position, director, tangent = section[:3], section[3:6], section[6:9]
    length, size = rod.beam.length, float(np.sqrt(force @ force)) + 1e-300
    if rod.shape == "rectangle":
        side = 1.0 if director @ force >= 0 else -1.0
        normal = side * director
        lever = -rod.half_height(s) * normal
        point = axes.T @ (position + lever - origin)
        across = np.array([-point[1] / length, point[0] / length])
        along = tangent
    else:
        distance, direction = obstacle.surface.distance(axes.T @ (position - origin))
        normal = axes @ direction
        second = cross(tangent, director)
        a, b = rod.half_height(s) * (normal @ director), rod.half_height(s) * (normal @ second)
        extent = float(np.sqrt(a * a + (rod.aspect_ratio * b) ** 2))
        lever = -rod.half_height(s) * (a * director + rod.aspect_ratio**2 * b * second) / extent
        point = axes.T @ (position + lever - origin)
        # The distance is least along the beam where its slope is that of the tapered surface.
        taper = (rod.tip_ratio - 1) * rod.beam.radius / length
        across = np.array([(distance - extent) / length, normal @ tangent - taper])
        along = tangent - (tangent @ normal) * normal
        along /= float(np.sqrt(along @ along))
    beside = cross(normal, along)
    pressing = float(force @ normal)
    drag = np.array([force @ along, force @ beside])
    errors = drag / size
    if previous is not None:
        lag = 0.0 if previous.sticks else previous.lag
        displacement = axes @ (point - previous.point - lag) - (s - previous.s) * tangent
        slip = np.array([displacement @ along, displacement @ beside])
        errors = slip / length if previous.sticks else errors
        if not previous.sticks:
            if previous.drag is not None:
                slip = -np.array([previous.drag @ along, previous.drag @ beside])
            speed = float(np.sqrt(slip @ slip)) + 1e-300
            errors = errors + obstacle.friction * pressing / size * slip / speed
    slope = float(np.sqrt(drag @ drag)) / (abs(pressing) + 1e-300)
    return Touch(np.concatenate([across, errors]), normal, lever, point, shift, slope)
