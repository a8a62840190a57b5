"""A weight that hangs from the beam: a force whose direction is gravity's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.fitting.uniform_estimate import uniform_estimate
from solver.instrument.beam_shape import UNIFORM, BeamShape, stated_shape
from solver.instrument.estimate import Outcome
from solver.instrument.rig import Gravity
from solver.instrument.transforms import turn_about_z
from solver.learning.hung_rigidity import hung_beam
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight
from tests.consistency import nees
from tests.hung import SIGMA, UNIT, hung, noisy
from tests.simulated import BEAM, measurement
from vbaa_bench.mechanics.rod import Rod

CONE = BeamShape(widths=np.array([-0.2]), covariance=np.diag([1e-12, 0.0, 0.0, 1e-12]))
SOFT = BeamShape(softness=0.05, covariance=np.diag([1e-12, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("place", "load", "heading", "motor_angle", "rod", "shape"),
    [
        (0.5, 1.5, math.pi / 2, 0.14, Rod(BEAM), UNIFORM),
        (0.9, 0.1, math.pi / 2, -0.14, Rod(BEAM), UNIFORM),
        (0.3, 4.0, 1.2, 0.1, Rod(BEAM), UNIFORM),
        (0.7, 3.0, 1.9, 0.0, Rod(BEAM), UNIFORM),
        (0.7, 2.0, 1.5, 0.1, Rod(BEAM, tip_ratio=0.8), CONE),
        (0.8, 1.0, 1.5, 0.1, Rod(BEAM, clamp_softness=0.05), SOFT),
    ],
)
def test_place_and_force_agree_with_the_world(
    place: float, load: float, heading: float, motor_angle: float, rod: Rod, shape: BeamShape
) -> None:
    exact, contact = hung(place, load, heading, motor_angle, rod, shape)
    estimate = hung_weight(exact)
    assert estimate.outcome is Outcome.CONTACT
    expected = {
        "x_c_m": contact.point[0],
        "s_c_m": contact.s,
        "force_n": load * UNIT,
        "force_x_n": contact.force[0],
        "force_y_n": contact.force[1],
    }
    for name, value in expected.items():
        assert estimate.values[name] == pytest.approx(value, rel=3e-6), name
    # The force is gravity's, also where the clamp has turned under its moment.
    heading_c = math.atan2(estimate.values["force_y_n"], estimate.values["force_x_n"])
    assert heading_c == pytest.approx(heading - motor_angle, abs=1e-8)


def test_an_encoder_matters_only_where_it_is_read() -> None:
    exact, _ = hung(0.5, 1.5)
    tolerances = replace(exact.rig.tolerances, encoder=math.radians(1))
    read = replace(exact, rig=replace(exact.rig, tolerances=tolerances))
    sigmas = [hung_weight(one).sigma("force_n") for one in (exact, read)]
    without = hung_weight(replace(read, motor_angle=None)).sigma("force_n")
    assert sigmas[1] > 1.01 * sigmas[0]
    assert without == pytest.approx(sigmas[0], rel=1e-6)


def test_a_normal_force_is_another_one() -> None:
    exact, contact = hung(0.5, 1.5)
    estimate, white = uniform_estimate(exact)
    assert abs(estimate.values["x_c_m"] - contact.point[0]) > 10 * estimate.sigma("x_c_m")
    assert not white
    assert exact_fit(exact).outcome is Outcome.INVALID


@pytest.mark.thorough
@pytest.mark.parametrize(("taper_sigma", "softness_sigma"), [(0.0, 0.0), (0.01, 0.01)])
def test_errors_are_as_large_as_the_sigmas(
    taper_sigma: float, softness_sigma: float, random: np.random.Generator
) -> None:
    squares, turns = [], []
    gravity_sigma = math.radians(0.2)
    shape = stated_shape(taper_sigma, softness_sigma, section=0.0, friction=0.0)
    for _ in range(90):
        load, heading = math.exp(random.uniform(-1, 1)), math.pi / 2 + random.uniform(-0.1, 0.1)
        place, motor_angle = random.uniform(0.35, 0.95), random.uniform(-0.14, 0.14)
        taper, softness = random.standard_normal(2) * [taper_sigma, softness_sigma]
        rod = Rod(BEAM, tip_ratio=1 + taper, clamp_softness=abs(softness))
        exact, contact = hung(place, load, heading, motor_angle, rod, shape)
        stated = Gravity(heading + gravity_sigma * random.standard_normal(), gravity_sigma)
        frame = replace(exact, rig=replace(exact.rig, gravity=stated))
        estimate = hung_weight(noisy(frame, random))
        if not estimate.outcome.has_values:
            continue
        truths = {
            "x_c_m": contact.point[0],
            "force_n": load * UNIT,
            "force_x_n": contact.force[0],
        }
        squares.append(nees(estimate, truths))
        turns.append(
            (estimate.values["theta_c_rad"] - contact.theta) / estimate.sigma("theta_c_rad")
        )
    assert len(squares) > 84  # a start fails for one in 700, a heavy weight near the tip
    # chi^2 of three degrees of freedom, 90 trials: 3 +- 0.26.
    assert 1.2 < np.mean(squares) < 5.2
    # The clamp's tilt, which has a prior, is exact here.
    assert np.mean(np.square(turns)) < 2.2


def test_small_loads_are_those_of_a_linear_cantilever() -> None:
    # y = W x^2 (3 a - x) / 6 EI up to the weight at a, and straight beyond; W = 0.02 EI / L^2.
    x, a = np.arange(3e-3, BEAM.length, 0.5e-3), 0.6 * BEAM.length
    curve = np.where(x < a, (3 * a - x) * x**2, (3 * x - a) * a**2) / 6
    points = np.column_stack([x, 0.02 * curve / BEAM.length**2])
    frame = measurement(points, SIGMA, base_sigma=2e-6)
    frame = replace(frame, rig=replace(frame.rig, gravity=Gravity(math.pi / 2)))
    estimate = hung_weight(frame)
    assert estimate.values["force_n"] == pytest.approx(0.02 * UNIT, rel=2e-4)
    assert estimate.values["x_c_m"] == pytest.approx(a, rel=2e-4)


@pytest.mark.parametrize("level", [-0.1, 0.0, 0.15])
def test_it_agrees_with_the_beam_of_the_rigiditys_calibration(level: float) -> None:
    load, place = 1.5 / BEAM.length**2, 0.7 * BEAM.length
    curve = hung_beam(load, 0.0, place, level, BEAM.length)
    assert curve is not None
    x = np.arange(3e-3, curve.x[-1], 0.5e-3)
    frame = measurement(np.column_stack([x, curve(x)]), SIGMA, base_sigma=2e-6)
    # The clamp points down by `level`, towards y.
    rig = replace(frame.rig, gravity=Gravity(math.pi / 2))
    estimate = hung_weight(replace(frame, rig=rig, motor_angle=level))
    assert estimate.values["force_n"] == pytest.approx(1.5 * UNIT, rel=1e-5)
    assert estimate.values["s_c_m"] == pytest.approx(place, rel=1e-5)


def test_a_beam_that_bends_to_the_other_side_is_a_mirror_image() -> None:
    exact, _ = hung(0.6, 1.5, 1.4, 0.1)
    mirrored = replace(
        exact,
        antenna_from_beam=np.diag([1.0, -1.0, 1.0, 1.0]),
        motor_angle=-0.1,
        rig=replace(exact.rig, deflects_towards=-1, gravity=Gravity(-1.4)),
    )
    one, other = hung_weight(exact), hung_weight(mirrored)
    assert other.values["force_y_n"] == pytest.approx(-one.values["force_y_n"], rel=1e-9)
    assert other.values["x_c_m"] == pytest.approx(one.values["x_c_m"], rel=1e-9)


def test_without_an_encoder_gravity_has_its_direction_in_the_rest_images() -> None:
    exact, contact = hung(0.6, 1.5, 1.4, 0.1)
    turned = turn_about_z(0.1)[:2, :2]
    # A camera fixed in the world observes the beam turned by the motor.
    view = replace(exact.view, points=exact.points @ turned.T,
                   sigma_vectors=exact.sigma_vectors @ turned.T)  # fmt: skip
    rig = replace(exact.rig, camera_mount="world")
    base = np.diag([4e-12, 4e-12, 0.04])
    estimate = hung_weight(
        replace(exact, view=view, rig=rig, motor_angle=None, base_covariance=base)
    )
    assert estimate.values["s_c_m"] == pytest.approx(contact.s, rel=1e-5)
    assert estimate.values["force_n"] == pytest.approx(1.5 * UNIT, rel=1e-5)
    assert estimate.values["motor_angle_rad"] == pytest.approx(0.1, abs=1e-6)


def test_an_uncertain_beam_and_clamp_widen_the_sigmas() -> None:
    exact, contact = hung(0.6, 1.5)
    certain = hung_weight(exact)
    shape = stated_shape(taper=0.02, softness=0.01, section=0.0, friction=0.3)
    stated = hung_weight(replace(exact, rig=replace(exact.rig, shape=shape)))
    assert stated.sigma("force_n") > 2 * certain.sigma("force_n")
    assert stated.values["x_c_m"] == pytest.approx(contact.point[0], rel=1e-5)
    # Friction is an object's: a weight has none.
    smooth = stated_shape(taper=0.02, softness=0.01, section=0.0, friction=0.0)
    assert exact.rig.gravity is not None
    vague = replace(exact.rig, gravity=replace(exact.rig.gravity, sigma=0.02))
    answers = [
        hung_weight(replace(exact, rig=replace(vague, shape=without)))
        for without in (shape, smooth, replace(shape, rigid_objects=True))
    ]
    for other in answers[1:]:
        assert other.sigma("x_c_m") == pytest.approx(answers[0].sigma("x_c_m"), rel=1e-9)
        assert other.values["x_c_m"] == pytest.approx(answers[0].values["x_c_m"], rel=1e-9)


def test_a_rig_without_a_usable_gravity_is_refused() -> None:
    exact, _ = hung(0.6, 1.5)
    for gravity, message in (
        (None, "rig.json states no direction of gravity"),
        (Gravity(-math.pi / 2), "gravity pulls at 180 deg from the side to which contact bends"),
        (Gravity(0.2), "gravity pulls at 79 deg"),
    ):
        estimate = hung_weight(replace(exact, rig=replace(exact.rig, gravity=gravity)))
        assert estimate.outcome is Outcome.INVALID
        assert message in estimate.message
    strip = replace(exact.rig, known_psi=0.3)
    assert "plane C only" in hung_weight(replace(exact, rig=strip)).message
