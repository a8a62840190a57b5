"""Measurements of a beam from which a weight hangs, computed by the world, without images."""

import math
from dataclasses import replace

import numpy as np

from solver.instrument.beam_shape import UNIFORM, BeamShape
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Gravity
from tests.simulated import BEAM, columns, measurement
from vbaa_bench.mechanics.hung import hang
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor
from vbaa_bench.mechanics.state import Contact

UNIT = BEAM.flexural_rigidity / BEAM.length**2
SIGMA = 0.0075 * 0.51e-3  # 0.0075 px [m]


def hung(
    place: float,
    load: float,
    heading: float = math.pi / 2,
    motor_angle: float = 0.0,
    rod: Rod | None = None,
    shape: BeamShape = UNIFORM,
) -> tuple[Measurement, Contact]:
    """Noise-free columns of a beam under a weight, and the truth.

    The weight [EI / L^2] hangs at an arc length `place` [L]; `heading` [rad] is gravity's in
    Sigma_o.
    """
    force = load * UNIT * np.array([math.cos(heading), math.sin(heading), 0.0])
    # The world's motor turns backwards, so that the beam approaches an object.
    state = hang(rod or Rod(BEAM), Motor(), place * BEAM.length, force, [-motor_angle], 4000)[0]
    exact = measurement(columns(state.centreline), SIGMA, base_sigma=2e-6)
    rig = replace(exact.rig, gravity=Gravity(heading), shape=shape)
    return replace(exact, rig=rig, motor_angle=motor_angle), state.contact


def noisy(exact: Measurement, random: np.random.Generator) -> Measurement:
    """The measurement with the noise that it states."""
    points = exact.points.copy()
    points[:, 1] += SIGMA * random.standard_normal(len(points))
    return replace(exact, view=replace(exact.view, points=points))
