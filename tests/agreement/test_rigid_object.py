"""The direction of friction at a rigid object: the bend of one frame and the world's own path."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.beams.stretch import WIDTHS
from solver.fitting.frame_problem import frame_problem_of
from solver.fitting.rigid_object import friction_sign_of
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.beam_shape import stated_shape
from solver.instrument.rig import ClampOffset
from solver.instrument.transforms import rigid
from solver.uniform.problem import problem_of
from tests.simulated import columns
from tests.tapered import bowed
from vbaa_bench.mechanics import pushing
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.surfaces import upright

# As thick as a beam gets: it turns on its thickness up to several degrees.
LENGTH, RADIUS, DISTANCE = 0.24, 6e-3, 0.13
THICK = Beam(LENGTH, 2 * RADIUS, circular_rigidity(4e6, 2 * RADIUS))
STATED = stated_shape(taper=0.0, softness=0.0, section=0.0, friction=0.4, rigid_objects=True)
ANGLES_DEG = np.arange(0.5, 16.0, 1.0)


@dataclass(frozen=True)
class Case:
    """A beam, with its bow of the tip over the length, its object's radius, and the motor's axis.

    Up to a pushing angle of `back_deg` the bend shows that it slides back, from `on_deg` on, on.
    """

    back_deg: float
    on_deg: float
    tip_ratio: float = 1.0
    bow: float = 0.0
    radius: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)


def directions(case: Case, friction: float) -> tuple[list[int], list[float]]:
    """What the bend says of each step of a push, and the world's friction over the coefficient."""
    rod = Rod(THICK, tip_ratio=case.tip_ratio, bow=(2 * case.bow / LENGTH, 0.0))
    slope, reach = math.atan(2 * case.bow * DISTANCE / LENGTH), rod.reach(DISTANCE, 0.0)
    line = np.array([DISTANCE, case.bow * DISTANCE**2 / LENGTH, 0.0])
    touched = Obstacle(
        upright(case.radius),
        rigid([0.0, 0.0, slope], line - [-reach * math.sin(slope), reach * math.cos(slope), 0.0]),
        friction=friction,
    )
    steps = [Step(pushing_angle=math.radians(angle)) for angle in ANGLES_DEG]
    shape = replace(STATED, widths=np.array([case.tip_ratio - 1]), covariance=np.zeros((4, 4)))
    believed, true = [], []
    for state in pushing.push(rod, Motor(case.axis), [touched], DISTANCE, steps, 1200):
        points = columns(state.centreline)
        removed = np.column_stack([np.zeros(len(points)), case.bow * points[:, 0] ** 2 / LENGTH])
        bow = np.array([case.bow * LENGTH, 0.0, 0.0])
        taken = bowed(points, removed, bow, np.zeros(3), shape)
        offset = ClampOffset(-np.array(case.axis[:2]))
        taken = replace(taken, rig=replace(taken.rig, beam=THICK, clamp_offset=offset))
        problem = frame_problem_of(taken, problem_of(taken, with_tip=False))
        contact, p = state.contact, problem.mean.copy()
        normal = float(contact.force @ contact.normal)
        ratio = float(contact.force @ contact.tangent) / normal
        p[[Q, S_C, FRICTION_RATIO]] = (
            normal * LENGTH**2 / THICK.flexural_rigidity,
            contact.s / LENGTH,
            ratio,
        )
        p[WIDTHS] = case.tip_ratio - 1
        believed.append(friction_sign_of(problem, p))
        true.append(ratio / friction)
    return believed, true


@pytest.mark.thorough
@pytest.mark.parametrize("friction", [0.05, 0.5])
@pytest.mark.parametrize(
    "case",
    [
        Case(5.5, 12.0),
        Case(5.5, 12.0, radius=0.01),
        Case(4.5, 9.5, tip_ratio=0.6),
        Case(4.5, 10.5, bow=0.03),
        Case(7.0, 14.0, bow=-0.03),
        Case(4.0, 10.0, axis=(-0.01, 0.0, 0.0)),
        Case(0.0, 5.0, axis=(-0.002, 0.003, 0.0)),
    ],
)
def test_the_world_slides_as_the_bend_says(case: Case, friction: float) -> None:
    believed, true = directions(case, friction)
    # The force is normal to a cone's surface, whose slope is that of its radius.
    slope = RADIUS * (1 - case.tip_ratio) / LENGTH / friction
    for direction, ratio in zip(believed, true, strict=True):
        assert direction == 0 or ratio == pytest.approx(direction - slope, abs=1e-3)
    for degrees, direction in zip(ANGLES_DEG, believed, strict=True):
        assert direction == -1 or degrees > case.back_deg
        assert direction == 1 or degrees < case.on_deg
