import math
from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement, View
from solver.methods.exact_fit import exact_fit
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM, measurement, pushed_points

SIGMA = 0.05 * 0.51e-3  # 0.05 px


@pytest.mark.parametrize("deflection", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("distance", [0.03, 0.12, 0.21])
def test_recovers_a_noise_free_beam(distance: float, deflection: float) -> None:
    points, x_c, force = pushed_points(distance, deflection)
    answer = exact_fit(measurement(points, SIGMA))
    assert answer.outcome is Outcome.CONTACT
    assert answer.values["x_c_m"] == pytest.approx(x_c, abs=1e-6 * BEAM.length)
    assert answer.values["force_n"] == pytest.approx(force, rel=1e-5)


def test_tolerances_of_the_rig_enter_the_covariance() -> None:
    points, x_c, force = pushed_points(0.15, 0.1)
    exact = exact_fit(measurement(points, 1e-8))
    vague = exact_fit(measurement(points, 1e-8, scale_sigma=1e-3))
    assert exact.sigma("x_c_m") < 1e-6
    assert vague.sigma("x_c_m") == pytest.approx(1e-3 * x_c, rel=1e-3)
    assert vague.sigma("force_n") == pytest.approx(2e-3 * force, rel=1e-3)


def test_a_straight_beam_is_no_contact(random: np.random.Generator) -> None:
    x = np.arange(0.003, 0.24, 0.51e-3)
    outcomes = [
        exact_fit(measurement(np.column_stack([x, SIGMA * random.standard_normal(len(x))]), SIGMA))
        for _ in range(50)
    ]
    assert sum(answer.outcome is Outcome.NO_CONTACT for answer in outcomes) >= 48
    assert all(not answer.values or answer.outcome is Outcome.WEAK_CONTACT for answer in outcomes)


def test_a_faint_contact_is_only_an_interval(random: np.random.Generator) -> None:
    points, x_c, _ = pushed_points(0.12, 0.0002)
    answers = []
    for _ in range(20):
        noise = SIGMA * random.standard_normal((len(points), 1))
        answers.append(exact_fit(measurement(points + np.array([0, 1]) * noise, SIGMA)))
    weak = [answer for answer in answers if answer.outcome is Outcome.WEAK_CONTACT]
    assert len(weak) >= 8  # 17.5 +- 1.5; where noise bends it otherwise, there is no value
    assert not any(answer.values for answer in answers if answer not in weak)
    for answer in weak:
        assert abs(answer.values["x_c_m"] - x_c) < MOST_SIGMAS * answer.sigma("x_c_m")


def test_a_contact_near_the_tip_is_flagged() -> None:
    points, _, _ = pushed_points(0.2399, 0.02)
    assert exact_fit(measurement(points, SIGMA)).outcome is Outcome.TIP_CONTACT


def test_impossible_shapes_are_refused() -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    bent_back = points * [1, -1]
    assert exact_fit(measurement(bent_back, SIGMA)).outcome is Outcome.INVALID
    # The same shape on a shorter beam would be touched beyond its tip.
    stretched = points * 1.7
    assert exact_fit(measurement(stretched, SIGMA)).outcome is Outcome.INVALID


def test_too_few_points_do_not_identify_a_contact() -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    for count in (0, 1, 7):
        answer = exact_fit(measurement(points[:count], SIGMA))
        assert answer.outcome is Outcome.NOT_IDENTIFIABLE
        assert answer.message


def test_only_the_first_fifth_visible_gives_an_honest_huge_covariance(
    random: np.random.Generator,
) -> None:
    points, x_c, _ = pushed_points(0.15, 0.1)
    near = points[points[:, 0] < 0.048]
    pulls = []
    for _ in range(40):
        seen = near + np.array([0, 1]) * SIGMA * random.standard_normal((len(near), 1))
        answer = exact_fit(measurement(seen, SIGMA, base_sigma=1e-6))
        assert answer.outcome in (Outcome.CONTACT, Outcome.WEAK_CONTACT)
        assert answer.sigma("x_c_m") > 0.02 * BEAM.length
        pulls.append((answer.values["x_c_m"] - x_c) / answer.sigma("x_c_m"))
    # Errors towards the clamp are the larger ones, 3.8 sigmas once in 200 images.
    assert np.sqrt(np.mean(np.square(pulls))) < 2


@pytest.mark.thorough
@pytest.mark.parametrize("distance", [0.06, 0.15, 0.21])
@pytest.mark.parametrize("share", [0.1, 0.2])
def test_a_short_visible_stretch_never_stops_the_fit_without_a_word(
    distance: float, share: float
) -> None:
    points, x_c, _ = pushed_points(distance, 0.1)
    near = points[points[:, 0] < share * BEAM.length]
    pulls = []
    for seed in range(300):
        answer = exact_fit(measurement(noisy(near, seed), SIGMA, base_sigma=2e-5))
        if answer.values:
            pulls.append((answer.values["x_c_m"] - x_c) / answer.sigma("x_c_m"))
        else:
            assert answer.outcome is Outcome.NOT_IDENTIFIABLE
    # Where a tenth of the beam has been measured, a contact near the tip is placed nearer to the
    # clamp, by 1.9 +- 0.3 of its sigmas (8 seeds); one in eight of these errs by more than four.
    assert np.median(np.abs(pulls)) < 3.6


def test_order_and_repetition_of_points_do_not_matter(random: np.random.Generator) -> None:
    points, x_c, _ = pushed_points(0.1, 0.1)
    shuffled = random.permutation(points)
    one, other = exact_fit(measurement(points, SIGMA)), exact_fit(measurement(shuffled, SIGMA))
    assert one.values["x_c_m"] == pytest.approx(other.values["x_c_m"], abs=1e-9)
    twice = exact_fit(measurement(np.repeat(points, 2, axis=0), SIGMA))
    assert twice.values["x_c_m"] == pytest.approx(x_c, abs=1e-6)


def noisy(points: Floats, seed: int) -> Floats:
    across = generator(__name__, seed).standard_normal(len(points))
    return points + np.outer(across, [0, SIGMA])


def test_a_run_of_outliers_that_agree_is_seen_through() -> None:
    points, x_c, _ = pushed_points(0.15, 0.1)
    errors, answered = list[float](), list[bool]()
    for seed in range(120):
        seen = noisy(points, seed)
        edge = (seen[:, 0] > 0.05) & (seen[:, 0] < 0.12)  # an occluder's edge, 30 % of the beam
        seen[edge, 1] += 1e-3 + 0.02 * (seen[edge, 0] - 0.05)
        answer = exact_fit(measurement(seen, SIGMA))
        answered.append(answer.outcome is Outcome.CONTACT)
        if answered[-1]:
            assert "points were rejected" in answer.message
            errors.append((answer.values["x_c_m"] - x_c) / answer.sigma("x_c_m"))
    assert np.mean(answered) > 0.85  # 0.96 +- 0.02: a fit may end with these points alone
    assert np.sqrt(np.mean(np.square(errors))) < 1.5  # 1.07 +- 0.07


def test_a_beam_bent_by_two_contacts_is_refused() -> None:
    points, _, _ = pushed_points(0.09, 0.1)
    later, _, _ = pushed_points(0.21, 0.1)
    count = min(len(points), len(later))
    # Bent between the two as no force at one place can.
    mixed = points[:count].copy()
    mixed[:, 1] = 1.6 * later[:count, 1] - 0.6 * points[:count, 1]
    answer = exact_fit(measurement(noisy(mixed, 0), SIGMA))
    assert answer.outcome is Outcome.INVALID
    assert answer.message


def test_far_too_many_outliers_are_refused(random: np.random.Generator) -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    seen = noisy(points, 0)
    off = random.random(len(seen)) < 0.7
    seen[off, 1] += random.uniform(-5e-3, 5e-3, int(off.sum()))
    answer = exact_fit(measurement(seen, SIGMA))
    assert not answer.values
    assert answer.message


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 1e3])
def test_a_beam_of_any_size_gets_the_same_answer(scale: float) -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    seen = measurement(noisy(points, 0), SIGMA)
    small = measurement(scale * noisy(points, 0), scale * SIGMA)
    unit = np.array([scale, scale, 1.0])
    beam = Beam(scale * BEAM.length, scale * BEAM.diameter, BEAM.flexural_rigidity)
    scaled = replace(
        small,
        base_covariance=seen.base_covariance * np.outer(unit, unit),
        rig=replace(small.rig, beam=beam),
    )
    one, other = exact_fit(seen), exact_fit(scaled)
    assert other.outcome is one.outcome
    assert other.values["x_c_m"] == pytest.approx(scale * one.values["x_c_m"], rel=1e-8)
    assert other.values["force_n"] == pytest.approx(one.values["force_n"] / scale**2, rel=1e-8)
    assert other.sigma("x_c_m") == pytest.approx(scale * one.sigma("x_c_m"), rel=1e-6)


def test_the_last_bit_of_a_point_does_not_matter(random: np.random.Generator) -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    seen = noisy(points, 0)
    nudged = np.nextafter(seen, random.choice([-np.inf, np.inf], seen.shape))
    one, other = exact_fit(measurement(seen, SIGMA)), exact_fit(measurement(nudged, SIGMA))
    for name in ("x_c_m", "force_n", "s_c_m"):
        assert other.values[name] == pytest.approx(one.values[name], rel=1e-9)


def test_collinear_and_coincident_points_are_answered_in_words() -> None:
    line = np.column_stack([np.linspace(0.01, 0.2, 50), np.full(50, 0.01)])
    coincident = np.tile([[0.1, 0.01]], (50, 1))
    outcomes = [
        exact_fit(measurement(points, SIGMA)).outcome
        for points in (line, coincident, line[:, ::-1])
    ]
    assert outcomes == [Outcome.NO_CONTACT, Outcome.NOT_IDENTIFIABLE, Outcome.NO_CONTACT]


def turned(points: Floats, angle: float) -> Measurement:
    """The beam as a camera that stands in the world sees it, the motor having turned."""
    c, s = math.cos(angle), math.sin(angle)
    rotation = np.array([[c, -s], [s, c]])
    seen = measurement(points, SIGMA)
    seen = replace(seen, view=View(points @ rotation.T, seen.sigma_vectors, seen.view.viewpoint))
    base = np.diag([1e-9, 1e-9, 0.5]) ** 2
    rig = replace(seen.rig, camera_mount="world")
    return replace(seen, rig=rig, motor_angle=None, base_covariance=base)


@pytest.mark.parametrize("angle", [-0.26, 0.0, 0.3])
def test_a_camera_in_the_world_finds_the_motors_angle(angle: float) -> None:
    points, x_c, _ = pushed_points(0.15, 0.1)
    errors = []
    for seed in range(20):
        answer = exact_fit(turned(noisy(points, seed), angle))
        values = answer.values
        errors.append(
            [
                (values["motor_angle_rad"] - angle) / answer.sigma("motor_angle_rad"),
                (values["x_c_m"] - x_c) / answer.sigma("x_c_m"),
            ]
        )
        assert values["contact_antenna_x_m"] == pytest.approx(values["x_c_m"], abs=1e-7)
        assert math.hypot(values["contact_world_x_m"], values["contact_world_y_m"]) == (
            pytest.approx(math.hypot(values["x_c_m"], values["y_c_m"]), rel=1e-6)
        )
    assert np.sqrt(np.mean(np.square(errors), axis=0)) == pytest.approx(1.0, abs=0.5)


def test_the_encoder_turns_the_contact_into_the_world() -> None:
    points, _, _ = pushed_points(0.15, 0.1)
    seen = replace(measurement(noisy(points, 0), SIGMA), motor_angle=-0.2)
    vague = replace(
        seen, rig=replace(seen.rig, tolerances=replace(seen.rig.tolerances, encoder=1e-3))
    )
    values, c, s = exact_fit(seen).values, math.cos(0.2), math.sin(0.2)
    x, y = values["contact_antenna_x_m"], values["contact_antenna_y_m"]
    assert values["contact_world_x_m"] == pytest.approx(c * x + s * y)
    assert values["contact_world_y_m"] == pytest.approx(c * y - s * x)
    assert exact_fit(vague).sigma("contact_world_y_m") == pytest.approx(
        1e-3 * (c * x + s * y), rel=0.1
    )
