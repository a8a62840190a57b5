import math
from dataclasses import replace

import numpy as np
import pytest

from solver.core.least_squares import fit_rows
from solver.fitting.push_frames import bent_frames
from solver.fitting.push_geometry import FirstTouch, ShapeContacts, Touch, touch
from solver.fitting.push_joint import FRICTION_PRIOR_SIGMA, Push
from solver.fitting.sliding import ratio_matrix
from solver.fitting.uniform_estimate import shape_quantities, uniform_estimate
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit
from solver.methods.push_fit import push_fit, push_fit_friction
from tests import frictional
from tests.consistency import MOST_SIGMAS, nees
from tests.draws import generator
from tests.oracle import oracle
from tests.simulated import BEAM
from tests.solver.methods.pushes import (
    ENCODER_SIGMA,
    ONSET,
    Object,
    beam_stiffness,
    dragged,
    measured_push,
    mirrored,
    still,
    with_tolerances,
)
from vbaa_bench.mechanics.planar import push

RIGIDITY = BEAM.flexural_rigidity
THERE_AND_BACK_DEG = (3.0, 6.0, 9.0, 12.0, 11.5, 9.0, 6.0, 3.0)


def touched(
    q: float, lever: float, friction_ratio: float, compliance: float, reach: float
) -> Touch | None:
    """The push of one shape, of an object at zero."""
    shape = np.array([[q], [lever], [friction_ratio]])
    at = frictional.contact(shape[0], shape[1], shape[2], BEAM.radius)
    contact = ShapeContacts(
        np.array([at.load, at.theta_c, at.x_c, at.y_c, at.s_c, at.lean]),
        np.array([at.d_load, at.d_theta_c, at.d_x_c, at.d_y_c, at.d_s_c, at.d_lean]),
    )
    first = FirstTouch(0.0, 0.0, 0.0, np.array([[1.0], [0.0], [0.0]]))
    return touch(contact, first, compliance, reach, RIGIDITY)


@pytest.mark.parametrize("compliance", [0.0, 0.01, 1.0])
@pytest.mark.parametrize("radius", [0.0, 5e-3])
@pytest.mark.parametrize("degrees", [2.0, 20.0])
def test_the_world_presses_as_the_antenna_believes(
    compliance: float, radius: float, degrees: float
) -> None:
    state = push(
        BEAM,
        0.11,
        pushing_angle=math.radians(degrees),
        object_radius=radius,
        compliance=compliance,
    )
    force = float(np.linalg.norm(state.contact.force))
    lever = -float(state.base_moment[2]) / force
    at = touched(force / RIGIDITY, lever, 0.0, compliance, radius + BEAM.radius)
    assert at is not None
    assert at.pushing_angle == pytest.approx(math.radians(degrees), abs=1e-12)
    assert at.excess == pytest.approx(0.11, abs=1e-13)


@pytest.mark.parametrize(
    ("compliance", "radius"),
    [
        (0.0, 0.0),
        pytest.param(0.0, 5e-3, marks=pytest.mark.thorough),
        (0.02, 2e-3),
    ],
)
def test_the_world_drags_as_the_antenna_believes(compliance: float, radius: float) -> None:
    states = dragged(0.12, compliance, radius, 0.3, THERE_AND_BACK_DEG)
    for degrees, (state, _) in zip(THERE_AND_BACK_DEG, states, strict=True):
        contact = state.contact
        force = float(np.linalg.norm(contact.force))
        friction_ratio = float(contact.force @ contact.tangent) / float(
            contact.force @ contact.normal
        )
        lever = -float(state.base_moment[2]) / force
        q = force / math.hypot(1, friction_ratio) / RIGIDITY
        at = touched(q, lever, friction_ratio, compliance, radius + BEAM.radius)
        assert at is not None
        # But for how the world follows the way in steps.
        assert at.pushing_angle == pytest.approx(math.radians(degrees), abs=1e-7)
        assert at.excess == pytest.approx(0.12, abs=1e-7)


def test_a_sharp_rigid_edge_agrees_with_the_oracle() -> None:
    case = oracle()["C_world_fixed_contact"][0]
    q = float(case["F_N"]) / RIGIDITY
    lever = math.sqrt(2 * math.sin(float(case["theta_c_rad"])) / q)
    at = touched(q, lever, 0.0, 0.0, 0.0)
    assert at is not None
    assert at.pushing_angle == pytest.approx(float(case["inputs"]["dtheta_rad"]), rel=1e-12)
    assert at.excess == pytest.approx(float(case["inputs"]["x0_m"]), rel=1e-12)


def test_the_gradients_of_a_push_are_its_derivatives() -> None:
    def pushed(p: Floats) -> Touch | None:
        q, lever, friction_ratio, compliance, reach = (float(value) for value in p)
        return touched(q, lever, friction_ratio, compliance, reach)

    p = np.array([15.0, 0.12, 0.3, 0.05, 3e-3])
    at = pushed(p)
    assert at is not None
    for i in range(5):
        step = np.zeros(5)
        step[i] = 1e-6 * p[i]
        after, before = pushed(p + step), pushed(p - step)
        assert after is not None
        assert before is not None
        slope = (after.pushing_angle - before.pushing_angle) / (2 * step[i])
        assert at.d_pushing_angle[i] == pytest.approx(slope, rel=1e-6, abs=1e-8)
        slope = (after.excess - before.excess) / (2 * step[i])
        assert at.d_excess[i] == pytest.approx(slope, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("mount", ["antenna", "world"])
def test_the_gradients_of_what_is_said_of_a_contact_are_its_derivatives(mount: str) -> None:
    measurement, _ = measured_push(still(0.12, 0.0), angles_deg=(5.0,))
    seen = mirrored(measurement)
    if mount == "world":
        seen = replace(seen, motor_angle=None)
    seen = replace(seen, rig=replace(seen.rig, camera_mount=mount))
    at = np.array([15.0, 0.12, 0.4, 1e-4, -2e-4, 0.01, 0.3, 0.02, 0.0])

    def values(p: Floats) -> tuple[Floats, Floats]:
        named, jacobian, _ = shape_quantities(seen, p, psi_fitted=True, clamp_fitted=True)
        assert len(named) == (19 if mount == "world" else 18)
        return np.array(list(named.values())), jacobian

    _, jacobian = values(at)
    for i, step in enumerate(1e-6 * np.abs(at)):
        if step == 0:
            continue
        moved = np.zeros(len(at))
        moved[i] = step
        slope = (values(at + moved)[0] - values(at - moved)[0]) / (2 * step)
        assert jacobian[:, i] == pytest.approx(slope, rel=1e-5, abs=1e-7)
    # Lengths that err by a share, all of them, but for where the clamp stands; of a thin beam.
    thin = replace(seen.rig.beam, diameter=1e-9)
    seen = replace(seen, rig=replace(seen.rig, beam=thin))
    still_clamp = at * [1, 1, 1, 0, 0, 1, 1, 1, 1]
    larger, smaller = (still_clamp * [s**-2, s, *[1] * 7] for s in (1 + 1e-6, 1 - 1e-6))
    slope = (values(larger)[0] - values(smaller)[0]) / 2e-6
    assert values(still_clamp)[1][:, 8] == pytest.approx(slope, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, math.inf])
@pytest.mark.parametrize("distance", [0.06, 0.2])
def test_recovers_a_noise_free_push(distance: float, ratio: float) -> None:
    own = 1 / beam_stiffness(distance)
    # Stated to be so sharp that neither a prior nor the last step of the fit matters.
    measurement, state = measured_push(
        still(distance, own / ratio), sigma=1e-7, base_sigma=(1e-7, 1e-7, 1e-6), encoder=1e-6
    )
    answer = push_fit(measurement)
    assert answer.outcome is Outcome.CONTACT
    force = float(np.linalg.norm(state.contact.force))
    for name, true, most in (
        ("compliance_m_per_n", own / ratio, 1e-4 * own / min(ratio, 1.0)),
        ("onset_angle_rad", ONSET, 1e-6),
        ("x_c_m", state.contact.point[0], 2e-6),
        ("y_c_m", state.contact.point[1], 2e-6),
        ("s_c_m", state.contact.s, 2e-6),
        ("theta_c_rad", state.contact.theta, 1e-5),
        ("force_n", force, 1e-4 * force),
    ):
        assert answer.values[name] == pytest.approx(true, abs=most), name


@pytest.mark.thorough
@pytest.mark.parametrize("ratio", [1.0, math.inf])
def test_its_covariance_is_honest(ratio: float, random: np.random.Generator) -> None:
    distance = 0.12
    own = 1 / beam_stiffness(distance)
    squares, compliances, pulls = [], [], []
    trials = 90
    for _ in range(trials):
        measurement, state = measured_push(
            still(distance, own / ratio), random, angles_deg=(3.0, 7.0, 11.0, 15.0)
        )
        answer = push_fit(measurement)
        assert answer.outcome is Outcome.CONTACT
        true = {
            "x_c_m": float(state.contact.point[0]),
            "force_n": float(np.linalg.norm(state.contact.force)),
            "compliance_m_per_n": own / ratio,
            "onset_angle_rad": ONSET,
        }
        squares.append(nees(answer, true))
        compliances.append(answer.values["compliance_m_per_n"] - true["compliance_m_per_n"])
        pulls.append(compliances[-1] / answer.sigma("compliance_m_per_n"))
    # chi^2 of four degrees of freedom, 90 trials: 4 +- 0.3, and of one: 1 +- 0.15.
    assert 2.2 < np.mean(squares) < 6.2
    assert np.mean(np.square(pulls)) < 2.2
    rmse = float(np.sqrt(np.mean(np.square(compliances))))
    # A hundredth of the spring; of a rigid object what the encoder leaves, 0.12 % of the beam's.
    assert rmse < (0.006 if ratio == 1.0 else 0.0018) * own
    if math.isinf(ratio):
        assert min(compliances) < 0 < max(compliances)


def test_a_spring_is_told_apart_from_a_rigid_object(random: np.random.Generator) -> None:
    own = 1 / beam_stiffness(0.12)
    soft = push_fit(measured_push(still(0.12, own), random)[0])
    assert soft.values["stiffness_n_per_m"] == pytest.approx(1 / own, rel=0.02)
    assert soft.sigma("stiffness_n_per_m") / soft.values["stiffness_n_per_m"] == pytest.approx(
        soft.sigma("compliance_m_per_n") / soft.values["compliance_m_per_n"]
    )
    reported = [
        "stiffness_n_per_m" in push_fit(measured_push(still(0.12, 0.0), random)[0]).values
        for _ in range(10)
    ]
    assert sum(reported) <= 5


def test_every_frame_adds_to_what_is_known_of_the_object(random: np.random.Generator) -> None:
    measurement, _ = measured_push(still(0.12, 0.05), random)
    frames = (*measurement.earlier, measurement)
    sigmas = []
    for count in (2, 4, 7):
        so_far = replace(frames[count - 1], earlier=frames[: count - 1])
        answer = push_fit(so_far)
        sigmas.append(answer.sigma("compliance_m_per_n"))
        assert abs(answer.values["compliance_m_per_n"] - 0.05) < 6 * sigmas[-1]
    assert sigmas[0] > sigmas[1] > sigmas[2]
    # Without friction a push has no memory: in whatever order the frames came.
    shuffled = push_fit(replace(measurement, earlier=measurement.earlier[::-1]))
    assert shuffled.values["compliance_m_per_n"] == pytest.approx(
        push_fit(measurement).values["compliance_m_per_n"], abs=0.02 * sigmas[2]
    )


def test_a_push_places_the_contact_better_than_its_last_frame(random: np.random.Generator) -> None:
    measurement, state = measured_push(still(0.12, 0.0), random)
    together, alone = push_fit(measurement), exact_fit(measurement)
    assert together.sigma("x_c_m") < alone.sigma("x_c_m")  # 0.75 +- 0.04 of it
    assert abs(together.values["x_c_m"] - state.contact.point[0]) < MOST_SIGMAS * together.sigma(
        "x_c_m"
    )


@pytest.mark.parametrize("side", [1, -1])
def test_the_contact_in_the_world(side: int) -> None:
    measurement, state = measured_push(still(0.12, 0.0), radius=0.0)
    answer = push_fit(measurement if side == 1 else mirrored(measurement))
    x, y, _ = state.contact.point
    angle = ONSET - math.radians(15)
    values = answer.values
    assert values["contact_antenna_x_m"] == pytest.approx(x, abs=2e-6)
    assert values["contact_antenna_y_m"] == pytest.approx(side * y, abs=2e-6)
    turned = (x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle))
    assert values["contact_world_x_m"] == pytest.approx(turned[0], abs=3e-6)
    assert values["contact_world_y_m"] == pytest.approx(side * turned[1], abs=3e-6)
    force_x, force_y, _ = state.contact.force
    assert values["force_x_n"] == pytest.approx(force_x, rel=1e-3)
    assert values["force_y_n"] == pytest.approx(side * force_y, rel=1e-3)
    assert values["displacement_y_m"] == pytest.approx(side * y, abs=2e-6)
    assert values["f_n"] == pytest.approx(force_y, rel=1e-3)
    assert values["onset_angle_rad"] == pytest.approx(side * ONSET, abs=2e-6)


def test_tolerances_of_the_rig_enter_the_covariance() -> None:
    measurement, _ = measured_push(still(0.12, 0.5), encoder=0.0, base_sigma=(1e-9, 1e-9, 1e-8))
    sharp = push_fit(measurement)
    vague = push_fit(with_tolerances(measurement, flexural_rigidity=0.05 * RIGIDITY))
    scaled = push_fit(replace(measurement, scale_sigma=0.01))
    name = "compliance_m_per_n"

    def added(answer_sigma: float) -> float:
        return math.sqrt(answer_sigma**2 - sharp.sigma(name) ** 2)

    # A shape tells compliance times EI, in units of length cubed.
    assert added(vague.sigma(name)) == pytest.approx(0.05 * 0.5, rel=0.01)
    assert added(scaled.sigma(name)) == pytest.approx(0.03 * 0.5, rel=0.01)


@pytest.mark.parametrize(
    "touched",
    [
        lambda step: (0.12 + 3e-3 * step, 0.0),  # creeps along the beam
        lambda step: (0.12 if step < 4 else 0.125, 0.0),  # jumps
        lambda step: (0.12, 0.3 - 0.03 * step),  # a spring that hardens
        lambda step: (0.2 if step == 0 else 0.08, 0.0),  # another object at first
    ],
)
def test_what_is_not_one_object_on_a_linear_spring_is_estimated_from_the_last_frame(
    touched: Object, random: np.random.Generator
) -> None:
    measurement, _ = measured_push(touched, random)
    answer, single = push_fit(measurement), exact_fit(measurement)
    assert answer.outcome is Outcome.CONTACT
    assert answer.message.startswith("from this frame alone: the 7 frames of the push do not fit")
    assert answer.values == single.values
    np.testing.assert_array_equal(answer.covariance, single.covariance)
    assert "compliance_m_per_n" not in answer.values


def test_an_impossible_object_is_refused() -> None:
    measurement, _ = measured_push(still(0.12, 0.0), generator(__name__, 11))
    # A motor that turns by more than it says seems to push a thing that comes to meet it.
    geared = [
        replace(frame, motor_angle=ONSET + 0.97 * ((frame.motor_angle or 0.0) - ONSET))
        for frame in (*measurement.earlier, measurement)
    ]
    answer = push_fit(replace(geared[-1], earlier=tuple(geared[:-1])))
    assert answer.outcome is Outcome.INVALID
    assert "axis" in answer.message
    # A thing that creeps outwards would have to be hollow.
    creeping, _ = measured_push(
        lambda step: (0.12 + 5e-4 * step, 0.0), generator(__name__, 12), radius=0.0
    )
    answer = push_fit(creeping)
    assert answer.message.startswith("from this frame alone: the contact's motion along the beam")
    assert answer.values == exact_fit(creeping).values


def test_outliers_do_not_move_the_object(random: np.random.Generator) -> None:
    measurement, _ = measured_push(still(0.12, 0.05), random)

    def spoilt(frame: Measurement) -> Measurement:
        points = frame.points.copy()
        points[100:140, 1] += 2e-3
        return replace(frame, view=replace(frame.view, points=points))

    frames = [spoilt(frame) for frame in (*measurement.earlier, measurement)]
    answer = push_fit(replace(frames[-1], earlier=tuple(frames[:-1])))
    assert answer.outcome is Outcome.CONTACT
    assert abs(answer.values["compliance_m_per_n"] - 0.05) < MOST_SIGMAS * answer.sigma(
        "compliance_m_per_n"
    )
    assert answer.sigma("compliance_m_per_n") < 1.3 * push_fit(measurement).sigma(
        "compliance_m_per_n"
    )


@pytest.mark.thorough
@pytest.mark.parametrize("radius", [0.0, 0.01])
def test_the_radius_of_the_object_is_honest(radius: float) -> None:
    errors, sigmas = [], []
    for seed in range(32):
        measurement, _ = measured_push(
            still(0.12, 0.0), generator(__name__, seed), radius=radius, scale_sigma=1e-4
        )
        answer = push_fit(measurement)
        sigmas.append(answer.sigma("object_radius_m"))
        errors.append((answer.values["object_radius_m"] - radius) / sigmas[-1])
    assert max(sigmas) < 1.3e-3
    # Bounds of chi^2 of 32 degrees of freedom, crossed once in 30 million runs.
    assert 0.43 < np.sqrt(np.mean(np.square(errors))) < 1.65


def test_a_push_that_does_not_determine_the_radius_reports_none(
    random: np.random.Generator,
) -> None:
    measurement, _ = measured_push(still(0.12, 0.0), random, radius=0.01, angles_deg=(3.0, 4.0))
    answer = push_fit(measurement)
    assert answer.outcome is Outcome.CONTACT
    assert "compliance_m_per_n" in answer.values
    assert "object_radius_m" not in answer.values


def test_a_single_object_is_not_refused(random: np.random.Generator) -> None:
    for distance, compliance, radius in ((0.05, 0.0, 0.0), (0.21, 0.3, 0.01), (0.12, 0.02, 0.005)):
        measurement, _ = measured_push(still(distance, compliance), random, radius=radius)
        assert push_fit(measurement).outcome is Outcome.CONTACT


def test_without_a_push_it_answers_as_a_single_frame(random: np.random.Generator) -> None:
    measurement, _ = measured_push(still(0.12, 0.0), random)
    first = measurement.earlier[0]
    unmoved = replace(measurement, earlier=(measurement, measurement))
    unread = replace(measurement, motor_angle=None)
    for lone, why in (
        (first, "no earlier"),
        (unmoved, "motor has not turned"),
        (unread, "no motor angle is read"),
    ):
        answer = push_fit(lone)
        assert answer.message.startswith("from this frame alone: ")
        assert why in answer.message
        assert answer.values == exact_fit(lone).values
        assert "compliance_m_per_n" not in answer.values


def test_frames_before_contact_are_left_out(random: np.random.Generator) -> None:
    measurement, _ = measured_push(still(0.12, 0.1), random)
    x = measurement.points[:, 0]
    straight = replace(
        measurement,
        view=replace(measurement.view, points=np.column_stack([x, 0 * x])),
        motor_angle=ONSET + 0.05,
        earlier=(),
    )
    longer = replace(measurement, earlier=(straight, *measurement.earlier))
    assert push_fit(longer).values == push_fit(measurement).values
    back: Measurement = replace(straight, earlier=(measurement,))
    assert push_fit(back).outcome is Outcome.NO_CONTACT


@pytest.mark.parametrize(
    ("side", "compliance"),
    [
        (1, 0.0),
        (-1, 0.14),
        pytest.param(1, 0.14, marks=pytest.mark.thorough),
        pytest.param(-1, 0.0, marks=pytest.mark.thorough),
    ],
)
def test_friction_is_told_by_a_push_there_and_back(compliance: float, side: int) -> None:
    measurement, state = measured_push(
        still(0.12, compliance), friction=0.3, angles_deg=THERE_AND_BACK_DEG, sigma=1e-5
    )
    answer = push_fit_friction(measurement if side == 1 else mirrored(measurement))
    assert answer.outcome is Outcome.CONTACT
    force_x, force_y, _ = state.contact.force
    force = math.hypot(force_x, force_y)
    # The nonlinear rest of what the stated sigmas allow.
    for name, true, most in (
        ("friction", 0.3, 1e-3),
        ("compliance_m_per_n", compliance, 1e-5),
        ("x_c_m", state.contact.point[0], 5e-6),
        ("s_c_m", state.contact.s, 5e-6),
        ("force_n", force, 1e-3 * force),
        ("force_x_n", force_x, 1e-3 * force),
        ("force_y_n", side * force_y, 1e-3 * force),
        ("onset_angle_rad", side * ONSET, 5e-5),
    ):
        assert answer.values[name] == pytest.approx(true, abs=most), name


def test_friction_acts_backwards_in_the_first_frame_after_a_reversal() -> None:
    measurement, state = measured_push(
        still(0.12, 0.0), friction=0.3, angles_deg=(6.0, 12.0, 6.0), sigma=1e-5
    )
    estimate = push_fit_friction(measurement)
    force_x, force_y, _ = state.contact.force
    assert estimate.values["friction"] == pytest.approx(0.3, abs=1e-3)
    assert estimate.values["force_x_n"] == pytest.approx(force_x, rel=2e-3)
    assert estimate.values["force_y_n"] == pytest.approx(force_y, rel=2e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("friction", [0.001, 0.3])
def test_its_sigmas_are_honest_whether_the_object_drags_or_not(
    friction: float, random: np.random.Generator
) -> None:
    squares = []
    for _ in range(40):
        measurement, state = measured_push(
            still(0.12, 0.0), random, friction=friction, angles_deg=(4.0, 12.0, 11.0, 4.0)
        )
        answer = push_fit_friction(measurement)
        assert answer.outcome is Outcome.CONTACT
        true = {
            "x_c_m": float(state.contact.point[0]),
            "force_n": float(np.linalg.norm(state.contact.force)),
            "compliance_m_per_n": 0.0,
            "friction": friction,
        }
        squares.append(nees(answer, true))
        assert answer.sigma("friction") < 0.08
    # chi^2 of four degrees of freedom, 40 trials: 3.7 +- 0.4.
    assert 1.3 < np.mean(squares) < 7.6


@pytest.mark.thorough
def test_friction_that_is_not_considered_is_found_out_or_misplaces_the_contact(
    random: np.random.Generator,
) -> None:
    there = THERE_AND_BACK_DEG[:4]
    errors: dict[bool, list[float]] = {False: [], True: []}
    pulls: dict[bool, list[float]] = {False: [], True: []}
    for _ in range(10):
        measurement, state = measured_push(still(0.12, 0.0), random, friction=0.3, angles_deg=there)
        for friction, found in errors.items():
            answer = push_fit(measurement, friction)
            if not friction and answer.outcome is Outcome.INVALID:
                continue  # one in ten looks like a beam that gets wider
            found.append(answer.values["x_c_m"] - state.contact.point[0])
            pulls[friction].append(found[-1] / answer.sigma("x_c_m"))
        back, _ = measured_push(
            still(0.12, 0.0), random, friction=0.3, angles_deg=THERE_AND_BACK_DEG
        )
        assert "frames of the push do not fit one object" in push_fit(back).message
    assert len(errors[False]) > 2
    assert np.median(np.abs(errors[False])) > 0.25e-3
    assert np.median(np.abs(pulls[False])) > 4
    assert np.sqrt(np.mean(np.square(errors[True]))) < 0.3e-3
    assert np.sqrt(np.mean(np.square(pulls[True]))) < 2.5


@pytest.mark.parametrize("known_psi", [None, 1e-6])
@pytest.mark.parametrize("friction", [0.3, 0.5])
def test_of_a_single_frame_friction_is_part_of_the_uncertainty(
    friction: float, known_psi: float | None
) -> None:
    measurement, state = measured_push(
        still(0.2, 0.0), friction=friction, angles_deg=(12.0,), base_sigma=(1e-6, 1e-6, 1e-5)
    )
    measurement = replace(measurement, rig=replace(measurement.rig, known_psi=known_psi))
    blind, aware = uniform_estimate(measurement).estimate, push_fit_friction(measurement)
    assert aware.message.startswith("from this frame alone")
    assert "friction" not in aware.values
    assert aware.values == blind.values
    force_x, force_y, _ = state.contact.force
    force = math.hypot(force_x, force_y)
    true = {"x_c_m": state.contact.point[0], "force_x_n": force_x, "f_n": force_y}
    for name, value in true.items():
        error = abs(blind.values[name] - value)
        assert error > 5 * blind.sigma(name), name
        added = math.sqrt(aware.sigma(name) ** 2 - blind.sigma(name) ** 2)
        assert 0.5 < added * friction / FRICTION_PRIOR_SIGMA / error < 2, name
    # The force's size changes with the square of the friction.
    error = abs(blind.values["force_n"] - force)
    assert error > 3 * blind.sigma("force_n") * (friction / 0.5) ** 2
    assert error < 2 * aware.sigma("force_n") < 0.3 * force


def test_what_is_not_told_of_friction_is_not_answered(random: np.random.Generator) -> None:
    short, _ = measured_push(still(0.12, 0.0), random, friction=0.3, angles_deg=(2.0, 2.5))
    answer = push_fit_friction(short)
    assert answer.outcome is Outcome.CONTACT
    assert "friction" not in answer.values
    assert "compliance_m_per_n" in answer.values


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("angles", "compliance"), [((12.0, 11.5, 9.0, 6.0, 3.0), 0.1), ((12.0, 9.0, 6.0, 3.0), 0.0)]
)
def test_a_push_may_be_seen_from_its_way_back_on(
    angles: tuple[float, ...], compliance: float, random: np.random.Generator
) -> None:
    pulls = []
    for _ in range(8):
        whole, state = measured_push(
            still(0.12, compliance), random, friction=0.3, angles_deg=angles
        )
        answer = push_fit_friction(replace(whole, earlier=whole.earlier[1:]))
        assert answer.outcome is Outcome.CONTACT
        force_x, force_y, _ = state.contact.force
        true = {
            "x_c_m": state.contact.point[0],
            "force_n": math.hypot(force_x, force_y),
            "force_x_n": force_x,
            "compliance_m_per_n": compliance,
        }
        pulls.append([(answer.values[k] - value) / answer.sigma(k) for k, value in true.items()])
    # The prior draws the friction towards zero, and the force with it: up to 1.2.
    assert (np.sqrt(np.mean(np.square(pulls), axis=0)) < 4).all()


def test_from_a_free_beam_on_a_push_begins_anew() -> None:
    before, _ = measured_push(still(0.12, 0.0), friction=0.4, angles_deg=(6.0, 12.0))
    again, state = measured_push(still(0.12, 0.0), friction=0.4, angles_deg=(3.0,))
    x = again.points[:, 0]
    free = replace(
        again,
        view=replace(again.view, points=np.column_stack([x, 0 * x])),
        motor_angle=ONSET + 0.05,
    )
    answer = push_fit_friction(replace(again, earlier=(*before.earlier, before, free)))
    force_x = state.contact.force[0]
    assert answer.values["force_x_n"] == pytest.approx(force_x, abs=answer.sigma("force_x_n"))
    assert answer.values["friction"] == pytest.approx(0.4, abs=answer.sigma("friction"))


def test_an_object_that_would_pull_the_beam_along_is_refused(random: np.random.Generator) -> None:
    # The way back, ordered as if it were the way there.
    whole, _ = measured_push(
        still(0.12, 0.0),
        random,
        friction=0.5,
        angles_deg=(15.0, 12.0, 9.0, 6.0, 3.0),
    )
    frames = (whole, *reversed(whole.earlier[1:]))
    answer = push_fit_friction(replace(frames[-1], earlier=frames[:-1]))
    assert answer.outcome is Outcome.INVALID
    assert "coefficient of friction would be negative" in answer.message


@pytest.mark.thorough
def joint_push(
    random: np.random.Generator, friction: float, angles_deg: tuple[float, ...]
) -> tuple[Push, Floats]:
    """A push of a uniform beam against an object at 120 mm, and a start of its fit."""
    last, _ = measured_push(still(0.12, 0.0), random, friction=friction, angles_deg=angles_deg)
    bent = bent_frames(last)
    assert bent is not None
    assert len(bent.frames) == len(angles_deg)
    pushing = np.radians(angles_deg)
    matrix = ratio_matrix(pushing, [False] * len(angles_deg), ENCODER_SIGMA, 0.0, 0.0)
    if not friction:
        matrix = matrix[:, :0]
    at_rest = [0.12, ONSET, 0.0, 2e-3, *[0.0] * matrix.shape[1]]
    return Push(bent.frames, last.rig, bent.beam, matrix), np.array([*bent.q, *bent.base, *at_rest])


# Of eight pushes, the mean of chi^2 is known to a hundredth; the limit is six times that.
@pytest.mark.parametrize("pushes", [8, pytest.param(24, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_tension_of_a_single_object_is_chance(
    friction: float, pushes: int, random: np.random.Generator
) -> None:
    angles = THERE_AND_BACK_DEG if friction else THERE_AND_BACK_DEG[:4]
    tensions, equations = [], 0
    for _ in range(pushes):
        push, start = joint_push(random, friction, angles)
        fit = fit_rows(push.residuals, start)
        assert fit.converged
        at = push.at(fit.parameters)
        assert at is not None
        tension, equations = at.consistency_chi2()
        tensions.append(tension)
    spread = math.sqrt(2 * equations / len(tensions))
    assert np.mean(tensions) == pytest.approx(equations, abs=6 * spread)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_an_offset_of_the_clamp_moves_the_fit_as_a_fit_with_it_is_moved(friction: float) -> None:
    push, start = joint_push(generator(__name__, 1), friction, THERE_AND_BACK_DEG)
    push = replace(push, offset_covariance=np.array([[4e-6, 1e-6], [1e-6, 1e-6]]))
    fit = fit_rows(push.residuals, start, step_sigmas=1e-7)
    at = push.at(fit.parameters)
    assert at is not None
    moved = at.moved_by_offset(fit.covariance)
    values, vectors = np.linalg.eigh(push.offset_covariance)
    sigmas = np.sqrt(np.diag(fit.covariance))
    for column, sigma in zip(moved.T, (vectors * np.sqrt(values)).T, strict=True):
        step = 0.01
        ahead, behind = (
            fit_rows(replace(push, offset=part * sigma).residuals, fit.parameters, step_sigmas=1e-7)
            for part in (step, -step)
        )
        # What the residuals gain by an offset, the fit takes back.
        by_offset = (behind.parameters - ahead.parameters) / (2 * step) / sigmas
        assert column / sigmas == pytest.approx(by_offset, abs=0.02 * np.abs(by_offset).max())


@pytest.mark.parametrize("friction", [False, True])
def test_a_push_may_bend_the_beam_by_half_a_right_angle(friction: bool) -> None:
    measurement, state = measured_push(still(0.12, 0.0), angles_deg=(10.0, 30.0, 50.0))
    answer = push_fit(measurement, friction)
    assert answer.outcome is Outcome.CONTACT, answer
    assert answer.message.startswith("3 frames")
    assert abs(answer.values["x_c_m"] - state.contact.point[0]) < 3 * answer.sigma("x_c_m")
