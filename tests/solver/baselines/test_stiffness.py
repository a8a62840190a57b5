import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from solver.baselines.stiffness import stiffness
from solver.baselines.two_point import two_point
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement, View
from tests.consistency import nees
from tests.simulated import BEAM, rig
from tests.solver.methods.pushes import (
    ONSET,
    beam_stiffness,
    measured_push,
    mirrored,
    still,
    with_tolerances,
)

DISTANCE = 0.12
OWN = 1 / beam_stiffness(DISTANCE)
# So little noise that the plain mean of all pairs is not biased by it.
SIGMA, BASE_SIGMA, ENCODER = 1e-7, (1e-7, 1e-7, 1e-6), 1e-6
ANGLES_DEG = (3.0, 5.0, 7.0, 9.0)


def linear_push(
    compliance: float,
    random: np.random.Generator | None = None,
    angles_deg: Sequence[float] = ANGLES_DEG,
    spacing: float = 0.51e-3,
) -> Measurement:
    """A push of the linear beam, eqs. (9) and (10), which is the method's own."""

    def noise(*shape: int) -> Floats:
        return np.zeros(shape) if random is None else random.standard_normal(shape)

    x = np.arange(3e-3, BEAM.length, spacing)
    dx, dy, tilt = np.array(BASE_SIGMA) * noise(3)
    frames: tuple[Measurement, ...] = ()
    for degrees in angles_deg:
        angle = math.radians(degrees)
        y_c = DISTANCE * math.tan(angle) / (1 + compliance / OWN)
        near = (3 * DISTANCE - x) * x**2
        beyond = (3 * x - DISTANCE) * DISTANCE**2
        y = y_c / (2 * DISTANCE**3) * np.where(x < DISTANCE, near, beyond)
        points = np.column_stack([x + dx, y + dy + tilt * x + SIGMA * noise(len(x))])
        frame = Measurement(
            view=View(points, SIGMA * np.tile([0.0, 1.0], (len(x), 1)), np.array([0.1, 0, 0.4, 1])),
            base_covariance=np.diag(np.square(BASE_SIGMA)),
            scale_sigma=0.0,
            motor_angle=ONSET - angle + ENCODER * float(noise(1)[0]),
            rig=rig(encoder=ENCODER),
        )
        frames = (*frames, frame)
    return replace(frames[-1], earlier=frames[:-1])


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, math.inf])
def test_recovers_a_linear_beam(ratio: float) -> None:
    answer = stiffness(linear_push(OWN / ratio))
    assert answer.outcome is Outcome.CONTACT
    assert answer.values["compliance_m_per_n"] == pytest.approx(
        OWN / ratio, rel=1e-4, abs=1e-6 * OWN
    )
    assert answer.values["onset_angle_rad"] == pytest.approx(ONSET, abs=1e-6)
    assert answer.values["x_c_m"] == pytest.approx(DISTANCE, abs=1e-7)
    assert ("stiffness_n_per_m" in answer.values) == math.isfinite(ratio)
    if math.isfinite(ratio):
        assert answer.values["stiffness_n_per_m"] == pytest.approx(ratio / OWN, rel=1e-4)


def test_recovers_a_linear_beam_up_to_large_angles() -> None:
    """The load grows as the tangent of any angle below 90 degrees."""
    estimate = stiffness(linear_push(OWN, angles_deg=(10.0, 30.0, 50.0, 65.0, 75.0)))
    assert estimate.values["compliance_m_per_n"] == pytest.approx(OWN, rel=1e-9)
    assert estimate.values["onset_angle_rad"] == pytest.approx(ONSET, abs=1e-9)


def frames_of(
    measurement: Measurement, change: Callable[[int, Measurement], Measurement]
) -> Measurement:
    """Apply a change to every frame of a push, by its number."""
    frames = (*measurement.earlier, replace(measurement, earlier=()))
    changed = tuple(change(i, frame) for i, frame in enumerate(frames))
    return replace(changed[-1], earlier=changed[:-1])


@pytest.mark.parametrize("rigidity_sigma", [1e-4, 0.1])
def test_every_error_enters_the_covariance_by_its_derivative(rigidity_sigma: float) -> None:
    """Compare with finite differences of the estimate by all measured and stated quantities."""
    sigma, (dx, dy, tilt), encoder, scale_sigma = 1e-6, (1e-6, 1e-6, 1e-5), 1e-5, 1e-4
    step = 1e-3  # of a sigma: the mean of pairs is not linear in larger errors

    def prepared(_: int, frame: Measurement) -> Measurement:
        points = frame.points[::8]
        frame = replace(
            frame,
            view=View(points, sigma * np.tile([0.0, 1.0], (len(points), 1)), frame.view.viewpoint),
            base_covariance=np.diag(np.square([dx, dy, tilt])),
            scale_sigma=scale_sigma,
        )
        rigidity = rigidity_sigma * BEAM.flexural_rigidity
        return with_tolerances(frame, encoder=encoder, flexural_rigidity=rigidity)

    measurement = frames_of(linear_push(OWN, angles_deg=(5.0, 9.0)), prepared)
    unchanged = stiffness(measurement)
    changes = []

    def add(change: Callable[[int, Measurement], Measurement]) -> None:
        values = stiffness(frames_of(measurement, change)).values
        changes.append((np.array(list(values.values())) - list(unchanged.values.values())) / step)

    def add_errors(points: Floats, motor: Floats) -> None:
        """Add the change by errors of the points (2, n, 2) [m] and of the motor (2,) [rad]."""

        def with_errors(i: int, frame: Measurement) -> Measurement:
            assert frame.motor_angle is not None
            view = replace(frame.view, points=frame.points + step * points[i])
            return replace(frame, view=view, motor_angle=frame.motor_angle + step * float(motor[i]))

        add(with_errors)

    points = np.stack([measurement.earlier[0].points, measurement.points])
    for frame, column in np.ndindex(points.shape[:2]):
        noise = np.zeros_like(points)
        noise[frame, column, 1] = sigma
        add_errors(noise, np.zeros(2))
    for motor in encoder * np.eye(2):
        add_errors(0 * points, motor)
    for clamp in ([dx, 0.0], [0.0, dy], tilt * points[:, :, :1] * [0.0, 1.0]):
        add_errors(0 * points + clamp, np.zeros(2))
    add_errors(scale_sigma * points, np.zeros(2))
    rigidity = (1 + step * rigidity_sigma) * BEAM.flexural_rigidity
    stiffer = replace(BEAM, flexural_rigidity=rigidity)
    add(lambda _, frame: replace(frame, rig=replace(frame.rig, beam=stiffer)))
    expected, stated = np.transpose(changes) @ changes, unchanged.covariance
    assert stated is not None
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert stated / size == pytest.approx(expected / size, abs=1e-2)


@pytest.mark.thorough
@pytest.mark.parametrize("ratio", [1.0, math.inf])
def test_its_covariance_is_honest(ratio: float, random: np.random.Generator) -> None:
    # Not x_c or the force beside them: the mean of the pairs errs to second order in the noise, and
    # with them the compliance is known so well in one direction that this shows.
    true = {"compliance_m_per_n": OWN / ratio, "onset_angle_rad": ONSET}
    squares, distances = [], []
    for _ in range(300):
        # The time grows with the square of the number of points.
        answer = stiffness(linear_push(OWN / ratio, random, spacing=2.5e-3))
        squares.append(nees(answer, true))
        distances.append((answer.values["x_c_m"] - DISTANCE) / answer.sigma("x_c_m"))
    # chi^2 of two degrees of freedom, 300 trials: 2 +- 0.12.
    assert 1.3 < np.mean(squares) < 2.8
    assert 0.75 < np.sqrt(np.mean(np.square(distances))) < 1.25


def test_the_tangent_keeps_stiff_objects_from_coming_out_soft_or_negative() -> None:
    # Linear theory on the real beam: biased, but by a few per cent of the beam's own compliance.
    for ratio in (1.0, math.inf):
        measurement, _ = measured_push(
            still(DISTANCE, OWN / ratio), angles_deg=(1.0, 1.5, 2.0, 2.5, 3.0), radius=0.0
        )
        answer = stiffness(measurement)
        assert answer.values["compliance_m_per_n"] == pytest.approx(OWN / ratio, abs=0.01 * OWN)
        assert answer.values["onset_angle_rad"] == pytest.approx(ONSET, abs=2e-4)


def test_a_mirrored_rig_answers_the_same(random: np.random.Generator) -> None:
    measurement = linear_push(OWN, random)
    one, other = stiffness(measurement), stiffness(mirrored(measurement))
    name = "compliance_m_per_n"
    assert other.values[name] == pytest.approx(one.values[name], rel=1e-9)
    assert other.sigma(name) == pytest.approx(one.sigma(name), rel=1e-9)
    assert other.values["onset_angle_rad"] == pytest.approx(-one.values["onset_angle_rad"])


def test_tolerances_of_the_rig_enter_the_covariance() -> None:
    measurement = linear_push(OWN)
    known = stiffness(measurement)
    vague = stiffness(with_tolerances(measurement, flexural_rigidity=0.1 * BEAM.flexural_rigidity))
    added = math.sqrt(
        vague.sigma("compliance_m_per_n") ** 2 - known.sigma("compliance_m_per_n") ** 2
    )
    assert added == pytest.approx(0.1 * OWN, rel=0.01)


def test_without_a_push_it_answers_as_two_point(random: np.random.Generator) -> None:
    measurement = linear_push(OWN, random)
    unmoved = replace(measurement, earlier=(measurement,))
    unread = replace(measurement, motor_angle=None)
    for lone in (measurement.earlier[0], unmoved, unread):
        answer = stiffness(lone)
        assert answer.message.startswith("from this frame alone: ")
        assert answer.values == two_point(lone).values
        assert "compliance_m_per_n" not in answer.values


def test_a_motor_that_turned_within_its_error_gives_no_compliance() -> None:
    measurement = linear_push(OWN, angles_deg=(5.0, 9.0))
    turned = math.radians(4.0)
    clear = stiffness(with_tolerances(measurement, encoder=turned / 6))
    assert clear.values["compliance_m_per_n"] == pytest.approx(OWN, rel=1e-9)
    unclear = stiffness(with_tolerances(measurement, encoder=turned / 3))
    assert "compliance_m_per_n" not in unclear.values
    assert "the motor has not turned" in unclear.message


def test_outcomes(random: np.random.Generator) -> None:
    measurement = linear_push(OWN, random)
    straight = replace(measurement.view, points=measurement.points * [1.0, 0.0])
    assert stiffness(replace(measurement, view=straight)).outcome is Outcome.NO_CONTACT
    # The load falls while the motor turns the beam against the object.
    swapped = tuple(
        replace(frame, motor_angle=2 * ONSET - (frame.motor_angle or 0.0))
        for frame in (*measurement.earlier, measurement)
    )
    answer = stiffness(replace(swapped[-1], earlier=swapped[:-1]))
    assert answer.outcome is Outcome.INVALID
    assert answer.message
