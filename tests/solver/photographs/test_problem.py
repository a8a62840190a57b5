"""One photograph's residuals: exact Jacobian, and the true beam has none."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.beams.beam import FRICTION_RATIO, POSE
from solver.beams.dead_load import direction_of, friction_ratio_of
from solver.beams.integrated import IntegratedBeam
from solver.core.least_squares import Rows
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BeamShape
from solver.photographs.bent_beam import places_on
from solver.photographs.fit import problems_of
from solver.photographs.photo_set import PhotoLoad, PhotoSet, Stated
from solver.photographs.problem import PhotoProblem
from tests.draws import generator
from tests.photo_sets import LENGTH, Force, Noise, TrueBeam, TrueCamera, bent, photograph
from tests.photo_sets import RIGIDITY as EI

BEAM = TrueBeam(widths=(-0.1,), bow=(0.004, -0.002, 0.001), softness=0.03)
# Where the beam begins to bend, beyond the clamp's mark.
SHIFT = 0.006
CAMERA = TrueCamera(k1=0.03, roll=0.1, view=(0.08, -0.05), distance=0.5)
WEIGHT, PUSH = Force("weight", 0.9, 0.3), Force("push", 0.8, 0.25, friction=0.2)
# A weight acts at the axis: the radius does not matter.
TAPERED = IntegratedBeam(1, 3, 0.0)


def one(load: Force | None) -> tuple[PhotoProblem, Floats]:
    """A photograph without noise, and its true parameters but roll, scale and place."""
    rng = generator(__name__, 0)
    tilt = 0.02
    photo, shown, _ = photograph(BEAM, CAMERA, load, tilt, rng, Noise(0.0, 0.0), marks=4)
    if load:
        stated = PhotoLoad(load.kind, Stated(load.size, 0.01), Stated(load.at + SHIFT, 0.001))
        photo = replace(photo, load=stated)
    arcs = np.array([0.1, 0.2, 0.35])
    ticks = CAMERA.pixels(bent(BEAM, load, tilt, arcs).rows[:, :2], BEAM.length)
    photo = replace(
        photo,
        clamp=CAMERA.pixels(np.array([[-SHIFT, 0.0]]), BEAM.length)[0],
        marks=photo.marks + np.array([0, 0, SHIFT, 0]),
        ticks=np.column_stack([ticks, arcs + SHIFT, np.full(3, 1e-3)]),
    )
    shape = BeamShape(widths=np.zeros(1), covariance=np.eye(4) * 1e-4)
    photos = PhotoSet((photo,), Stated(LENGTH, 1e-4), Stated(EI, EI / 10), shape)
    (problem,) = problems_of(photos, [shown])
    problem = replace(problem, sigmas=problem.sigmas * 1e2)  # 0.1 px
    scale = CAMERA.focal * LENGTH / CAMERA.distance
    shared = [0, 0, 0, math.log(CAMERA.focal), CAMERA.k1, BEAM.softness, SHIFT / LENGTH]
    shared += [*BEAM.widths, *BEAM.bow]
    own = [0.0, 0.5, 0.0, tilt, *problem.clamp, CAMERA.roll, math.log(scale), *CAMERA.view]
    if load:
        angle = bent(BEAM, load, tilt, np.array([LENGTH])).at_load[2]
        friction_ratio = load.friction if load.kind == "push" else math.tan(angle)
        own[:3] = (
            load.size * LENGTH**2 / EI / math.hypot(1.0, friction_ratio),
            load.at / LENGTH,
            friction_ratio,
        )
    return problem, np.array([*shared, *own])


def rows_at(problem: PhotoProblem, p: Floats) -> Rows:
    rows = problem.rows(p)
    assert rows is not None
    return rows


def nearest(problem: PhotoProblem, p: Floats) -> Floats:
    """Fit roll, scale and place of the view to the true pixels."""
    free = [problem.parameters["view"] + i for i in range(4)]
    for _ in range(12):
        rows = rows_at(problem, p)
        p = p.copy()
        p[free] -= np.linalg.lstsq(rows.jacobian[free].T, rows.residual)[0]
    return p


@pytest.mark.parametrize("load", [None, WEIGHT, PUSH])
def test_the_true_beam_has_no_residuals(load: Force | None) -> None:
    problem, p = one(load)
    p = nearest(problem, p)
    rows = rows_at(problem, p)
    # Two integrations of one beam: a thousandth of a pixel is a hundredth of these sigmas.
    labels = [name for name, count in problem.labels.items() for _ in range(count)]
    width = len(problem.points) + labels.index("width")
    assert np.abs(np.delete(rows.residual, width)).max() < 0.02
    # The log of the width is not quite linear along the beam.
    assert abs(rows.residual[width]) < 0.2


@pytest.mark.parametrize("load", [None, WEIGHT, PUSH])
def test_the_jacobian_is_that_of_differences(load: Force | None) -> None:
    problem, p = one(load)
    p = nearest(problem, p)
    rows = rows_at(problem, p)
    for i in range(len(p)):
        step = np.zeros(len(p))
        step[i] = 1e-6 * max(1.0, abs(p[i]))
        ahead, behind = rows_at(problem, p + step), rows_at(problem, p - step)
        difference = (ahead.residual - behind.residual) / (2 * step[i])
        largest = max(np.abs(difference).max(), 1.0)
        assert np.abs(rows.jacobian[i] - difference).max() < 2e-3 * largest, i


def test_a_step_keeps_the_images_of_clamp_and_tip() -> None:
    problem, p = one(WEIGHT)
    p = nearest(problem, p)
    step = np.zeros(len(p))
    step[-2:] = 0.1, -0.1
    moved = rows_at(problem, problem.moved(p, step))
    before, plain = rows_at(problem, p), rows_at(problem, p + step)
    ends = slice(len(problem.points), len(problem.points) + 4)  # clamp and tip
    expected = before.residual[ends] + step @ before.jacobian[:, ends]
    assert moved.residual[ends] == pytest.approx(expected, abs=1e-6)
    assert np.abs(plain.residual[ends] - expected).max() > 1


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("load", [0.05, 1.5, 3.0])
def test_a_dead_load_keeps_its_direction(load: float, side: int) -> None:
    p = np.array([load, 0.7, 0.0, -0.1, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.03 * side, 0.02])
    direction = math.pi / 2 + 0.1
    friction_ratio = friction_ratio_of(TAPERED, p, direction)
    assert friction_ratio is not None
    p[FRICTION_RATIO] = friction_ratio.value
    shape = TAPERED.bent(p[:-POSE])
    assert shape is not None
    assert direction_of(shape, p).value == pytest.approx(direction, abs=1e-12)
    for i in range(len(p)):
        step = np.zeros(len(p))
        step[i] = 1e-5
        ahead, behind = (
            friction_ratio_of(TAPERED, p + step, direction),
            friction_ratio_of(TAPERED, p - step, direction),
        )
        assert ahead
        assert behind
        difference = (ahead.value - behind.value) / 2e-5
        assert friction_ratio.gradient[i] == pytest.approx(difference, rel=1e-6, abs=1e-6)


def test_a_light_weight_bends_a_beam_as_linear_theory_says() -> None:
    """Deflection under the load F a^3 / (3 EI), and of the tip F a^2 (3 L - a) / (6 EI)."""
    load, at = 1e-3, 0.6
    beam = IntegratedBeam(0, 3, 0.0)
    p = np.array([load, at, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    friction_ratio = friction_ratio_of(beam, p, math.pi / 2)
    assert friction_ratio is not None
    p[FRICTION_RATIO] = friction_ratio.value
    shape = beam.bent(p[:-POSE])
    assert shape is not None
    contact, end = places_on(shape, p, np.array([at, 1.0]))
    assert contact == pytest.approx([at, load * at**3 / 3], rel=1e-5)
    tip = load * at**2 * (3 - at) / 6
    assert end == pytest.approx([1.0, tip], rel=1e-5)


def test_the_tip_of_a_bowed_beam_is_where_an_integration_ends() -> None:
    at, tilt = 0.3, 0.02
    rows = bent(BEAM, Force("weight", 0.9, at), tilt, np.array([BEAM.length])).rows
    problem, p = one(WEIGHT)
    p = nearest(problem, p)
    beam = problem.bent(p)
    assert beam is not None
    tip = places_on(beam.shape, beam.q, np.ones(1))[0] * [1.0, problem.side] * BEAM.length
    assert tip - [SHIFT, 0.0] == pytest.approx(rows[-1, :2], abs=1e-6)
    force, _ = problem.force(p, beam)
    assert force == pytest.approx(0.9, rel=1e-5)
    assert p[problem.parameters.indices("rigidity", "focal", "k1")] == pytest.approx(
        [0.0, math.log(3000.0), 0.03]
    )
