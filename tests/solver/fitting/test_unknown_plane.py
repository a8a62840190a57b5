"""Tip and moment sensor of a beam of changing section in an inclined plane."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.fitting.frame_problem import frame_problem_of
from solver.fitting.robust_fit import residuals_at
from solver.fitting.unknown_plane import spatial
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BeamShape
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Tip
from solver.methods.exact_fit_3d import exact_fit_3d
from solver.uniform.problem import problem_of
from tests.consistency import MOST_SIGMAS
from tests.simulated import BEAM
from tests.tapered import bent, measured

SHAPE = BeamShape(
    widths=np.array([-0.2]),
    softness=0.02,
    covariance=np.diag([1e-3, 0.0, 0.014, 1e-2]) ** 2,
    section_sigma=0.02,
    friction_sigma=0.2,
)


def test_the_gradients_of_the_residuals_are_their_derivatives(random: np.random.Generator) -> None:
    beam = bent(-0.2, 0.6, 1.2)
    taken = measured(beam, SHAPE, random)
    end = beam.centreline[-1, 1:3]
    tip = Tip(end + 1e-5, np.diag([1e-5, 5e-4]) ** 2, rim=1e-3)
    sensors = replace(taken.rig.sensors, moment_y=1e-4)
    rig = replace(taken.rig, sensors=sensors)
    taken = replace(taken, view=replace(taken.view, tip=tip), rig=rig, moment_y=-2e-3)
    problem = problem_of(taken)
    space = spatial(frame_problem_of(taken, problem), problem)
    at = space.parameters
    p = space.mean.copy()
    p[:4] = 1.2, 0.6, 0.1, -0.2
    p[at["psi"]], p[at["dx"]], p[at["softness"]] = 0.4, 1e-4, 0.02
    rows = residuals_at(space, p)
    assert rows is not None
    residual, jacobian = rows
    assert len(residual) == problem.points + 3
    for i in range(len(p)):
        step = np.zeros(len(p))
        step[i] = 1e-6
        after, before = residuals_at(space, p + step), residuals_at(space, p - step)
        assert after is not None
        assert before is not None
        slope = ((after[0] - before[0]) / 2e-6)[-3:]
        assert slope == pytest.approx(jacobian[i, -3:], rel=1e-5, abs=1e-3)


def test_the_end_is_seen_at_its_rim(random: np.random.Generator) -> None:
    rim, psi = 1e-3, 0.7
    viewpoint = np.array([0.12, -0.1, 0.36, 1.0])
    taken = measured(bent(-0.2, 0.6, 1.2), SHAPE, random)
    view = replace(taken.view, tip=Tip(np.zeros(2), 1e-12 * np.eye(2)), viewpoint=viewpoint)
    taken = replace(taken, view=view)
    problem = problem_of(taken)
    model = frame_problem_of(taken, problem)
    p, at = model.mean.copy(), model.parameters
    p[:2], p[at["psi"]] = (1.2, 0.6), psi
    p[[at[name] for name in ("softness", "dx", "dy", "tilt")]] = 0.0
    length = 1 - float(model.mean[at["dx"]])
    shape = model.bent(p)
    assert shape is not None
    # The end in space, and the nearest place of its rim, square to the beam there.
    _, theta, x_c, y_c, s_c, _ = shape.contacts[-1]
    cosine, sine = math.cos(theta), math.sin(theta)
    inclined = np.array([0.0, math.cos(psi), math.sin(psi)])
    tangent = np.array([cosine, 0.0, 0.0]) + sine * inclined
    end = np.array([x_c, 0.0, 0.0]) + y_c * inclined + (length - s_c) * tangent
    up = np.array([0.0, 0.0, 1.0])
    seen = _through(end * BEAM.length + rim * (up - up @ tangent * tangent), viewpoint)
    # `Antenna.tip_in_beam_frame` removes what the rim's height moves it where it is parallel to C.
    place = seen - rim * (seen - viewpoint[:2]) / viewpoint[2]
    errors = []
    for height in (rim, 0.0):
        tip = Tip(place, 1e-12 * np.eye(2), rim=height)
        arrays = problem_of(replace(taken, view=replace(view, tip=tip))).arrays
        space = spatial(model, replace(problem, arrays=arrays))
        space = replace(space, tips=arrays.tips)  # without the error of the length
        rows = residuals_at(space, p)
        assert rows is not None
        errors.append(float(np.hypot(*rows[0][-2:])))
    # In micrometres: the rim of this end is nearer to the clamp by its slope, to second order.
    assert errors[1] == pytest.approx(1e6 * rim * sine * math.sin(psi), rel=0.1)
    assert errors[0] < 0.03 * errors[1]


def _through(point: Floats, viewpoint: Floats) -> Floats:
    """Image (2,) on plane C of a point in space."""
    ray = viewpoint[:3] - point
    return np.asarray((point - point[2] / ray[2] * ray)[:2])


def test_a_cone_in_a_plane_of_unknown_inclination(random: np.random.Generator) -> None:
    beam = bent(-0.2, 0.6, 1.2)
    known = replace(SHAPE, softness=0.0, covariance=np.diag([0.0, 0.0, 0.014, 0.1]) ** 2)
    taken = measured(beam, known, random)
    # In plane C; the tip alone determines the inclination, whose sign is that of the viewpoint.
    end = beam.centreline[-1, 1:3]
    tip = Tip(end, np.diag([5e-6, 5e-4]) ** 2)
    viewpoint = np.array([0.12, -0.1, 0.36, 1.0])
    view = replace(taken.view, tip=tip, viewpoint=viewpoint)
    estimate = exact_fit_3d(replace(taken, view=view))
    assert estimate.outcome is Outcome.CONTACT
    truth = {"psi_rad": 0.0, "x_c_m": float(beam.points[0, 0])}
    for name, value in truth.items():
        assert abs(estimate.values[name] - value) < MOST_SIGMAS * estimate.sigma(name), name
    assert estimate.sigma("psi_rad") < 0.2
    assert estimate.sigma("x_c_m") < 0.01 * BEAM.length


def test_a_moment_sensor_determines_the_inclination(random: np.random.Generator) -> None:
    beam = bent(-0.2, 0.6, 1.2)
    known = replace(SHAPE, softness=0.0, covariance=np.diag([0.0, 0.0, 0.014, 0.1]) ** 2)
    taken = measured(beam, known, random)
    viewpoint = np.array([0.12, -0.1, 0.36, 1.0])
    rig = replace(taken.rig, sensors=replace(taken.rig.sensors, moment_y=2e-5))
    with_sensor = replace(
        taken, view=replace(taken.view, viewpoint=viewpoint), rig=rig, moment_y=1e-5
    )
    estimate = exact_fit_3d(with_sensor)
    assert estimate.outcome is Outcome.CONTACT
    # The reading's sigma over the moment in the plane of deflection.
    moment = abs(beam.base_moment[2])
    assert estimate.sigma("psi_rad") == pytest.approx(2e-5 / moment, rel=0.3)
    assert abs(estimate.values["psi_rad"]) < MOST_SIGMAS * estimate.sigma("psi_rad")
    assert abs(estimate.values["psi_rad"]) == pytest.approx(1e-5 / moment, rel=0.5)
