"""Whole pushes without images: the world's mechanics, seen as points with known noise."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Rig, Sensors, Tolerances
from tests.simulated import BEAM, columns, rig
from tests.vbaa_bench.mechanics.benches import obstacle
from vbaa_bench.mechanics import pushing
from vbaa_bench.mechanics.planar import push
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import State
from vbaa_bench.mechanics.surfaces import upright

SIGMA = 0.05 * 0.51e-3  # 0.05 px
BASE_SIGMA = (SIGMA, SIGMA, 2e-4)
ENCODER_SIGMA = math.radians(0.01)
ONSET = 0.17
ANGLES_DEG = (3.0, 5.0, 7.0, 9.0, 11.0, 13.0, 15.0)

# Contact distance [m] and compliance [m/N] of the object at each step.
Object = Callable[[int], tuple[float, float]]


def still(distance: float, compliance: float) -> Object:
    """An object at one place."""
    return lambda _step: (distance, compliance)


def beam_stiffness(distance: float) -> float:
    """3 EI / x_c^3 [N/m], what the beam itself opposes to a push at a distance [m]."""
    return 3 * BEAM.flexural_rigidity / distance**3


@lru_cache(maxsize=256)
def pushed(
    distance: float, compliance: float, radius: float, angle_deg: float
) -> tuple[State, Floats]:
    """The equilibrium, and its noise-free columns (n, 2)."""
    state = push(
        BEAM,
        distance,
        pushing_angle=math.radians(angle_deg),
        object_radius=radius,
        compliance=compliance,
        intervals=4000,
    )
    return state, columns(state.centreline)


@lru_cache(maxsize=32)
def dragged(
    distance: float,
    compliance: float,
    radius: float,
    friction: float,
    angles_deg: tuple[float, ...],
    tip_ratio: float = 1.0,
) -> list[tuple[State, Floats]]:
    """As `pushed`, each step after the other: friction remembers the way."""
    rod = Rod(BEAM, tip_ratio=tip_ratio)
    touched = obstacle(rod, distance, upright(radius), compliance=compliance, friction=friction)
    steps = [Step(pushing_angle=math.radians(angle)) for angle in angles_deg]
    states = pushing.push(rod, Motor(), [touched], distance, steps, 4000)
    return [(state, columns(state.centreline)) for state in states]


def measured_push(
    touched: Object,
    random: np.random.Generator | None = None,
    *,
    radius: float = 2e-3,
    friction: float = 0.0,
    angles_deg: Sequence[float] = ANGLES_DEG,
    base_sigma: tuple[float, float, float] = BASE_SIGMA,
    encoder: float = ENCODER_SIGMA,
    onset: float = ONSET,
    scale_sigma: float = 0.0,
    sigma: float = SIGMA,
    tip_ratio: float = 1.0,
    **tolerances: float,
) -> tuple[Measurement, State]:
    """The last frame of a push with all before it, and its true state.

    Without `random` nothing errs, though the sigmas are stated. With `friction` the object stays
    what it is at first.
    """
    known = rig(encoder=encoder, **tolerances)

    def noise(*shape: int) -> Floats:
        return np.zeros(shape) if random is None else random.standard_normal(shape)

    dx, dy, tilt = np.array(base_sigma) * noise(3)
    cosine, sine = math.cos(tilt), math.sin(tilt)
    if friction or tip_ratio != 1:
        states = dragged(*touched(0), radius, friction, tuple(angles_deg), tip_ratio)
    else:
        states = [pushed(*touched(i), radius, angle) for i, angle in enumerate(angles_deg)]
    frames: tuple[Measurement, ...] = ()
    for angle_deg, (_, points) in zip(angles_deg, states, strict=True):
        seen = points @ np.array([[cosine, sine], [-sine, cosine]]) + [dx, dy]
        seen[:, 1] += sigma * noise(len(seen))
        across = np.column_stack([np.zeros(len(seen)), np.full(len(seen), sigma)])
        frame = Measurement(
            view=View(seen, across, np.array([0.12, 0.0, 0.36, 1.0])),
            base_covariance=np.diag(np.square(base_sigma)),
            scale_sigma=scale_sigma,
            motor_angle=onset - math.radians(angle_deg) + encoder * float(noise(1)[0]),
            rig=known,
        )
        frames = (*frames, frame)
    return replace(frames[-1], earlier=frames[:-1]), states[-1][0]


def mirrored(measurement: Measurement) -> Measurement:
    """The same push by a rig that deflects towards -y: the motor turns the other way."""
    turned = replace(measurement.rig, deflects_towards=-1)
    assert measurement.motor_angle is not None
    return replace(
        measurement,
        rig=turned,
        motor_angle=-measurement.motor_angle,
        antenna_from_beam=np.diag([1.0, -1.0, 1.0, 1.0]),
        earlier=tuple(mirrored(frame) for frame in measurement.earlier),
    )


def sensing_rig(force: float, moment: float) -> Rig:
    """The reference rig with a sensor at the clamp, of one sigma each [N], [N m]."""
    return replace(rig(), sensors=Sensors(base_force=force, base_moment=moment))


def with_tolerances(measurement: Measurement, **changes: float) -> Measurement:
    """The same push by a rig of other tolerances."""
    tolerances: Tolerances = replace(measurement.rig.tolerances, **changes)
    return replace(measurement, rig=replace(measurement.rig, tolerances=tolerances))
