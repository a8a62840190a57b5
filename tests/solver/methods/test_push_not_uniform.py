"""Pushes of beams that are not uniform, on clamps that give, against rough objects."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.beams.integrated import IntegratedBeam
from solver.fitting.push_beam import PushBeam
from solver.fitting.push_frames import bent_frames
from solver.fitting.push_geometry import ShapeContacts
from solver.fitting.push_joint import Push
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BeamShape, stated_shape
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement, View
from solver.methods.push_fit import _sliding, push_fit, push_fit_friction
from tests.simulated import BEAM
from tests.solver.methods.pushes import ONSET, measured_push, still

CONE = BeamShape(
    widths=np.array([-0.1, 0.05]),
    softness=0.03,
    covariance=np.diag([1e-4, 0.0, 2e-4, 1e-4, 1e-4]),
    section_sigma=0.02,
    friction_sigma=0.2,
)


def of(measurement: Measurement, shape: BeamShape) -> Measurement:
    """The same push by a rig that states this beam."""
    rig = replace(measurement.rig, shape=shape)
    earlier = tuple(replace(frame, rig=rig) for frame in measurement.earlier)
    return replace(measurement, rig=rig, earlier=earlier)


def pulls(estimate: Estimate, truth: dict[str, float]) -> dict[str, float]:
    return {
        name: (estimate.values[name] - value) / estimate.sigma(name)
        for name, value in truth.items()
    }


def test_a_beam_that_is_known_to_be_uniform_is_pushed_as_before() -> None:
    measurement, _ = measured_push(still(0.12, 0.05))
    closed = push_fit(measurement)
    integrated = push_fit(of(measurement, stated_shape(1e-9, 0.0, 0.0, 0.0)))
    assert integrated.values.keys() == closed.values.keys()
    for name, value in closed.values.items():
        assert integrated.sigma(name) == pytest.approx(closed.sigma(name), rel=2e-2, abs=1e-15)
        assert integrated.values[name] == pytest.approx(
            value, abs=0.05 * closed.sigma(name) + 1e-12
        )


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_push_of_a_cone_is_what_the_world_measures(friction: float) -> None:
    measurement, state = measured_push(
        still(0.14, 0.02), friction=friction, tip_ratio=0.7, sigma=3e-6, angles_deg=(4.0, 8.0, 12.0)
    )
    estimate = push_fit_friction(of(measurement, stated_shape(0.4, 0.0, 0.0, friction or 1e-6)))
    assert estimate.outcome is Outcome.CONTACT
    force = float(np.linalg.norm(state.contact.force))
    assert estimate.values["x_c_m"] == pytest.approx(state.contact.point[0], abs=2e-5)
    assert estimate.values["force_n"] == pytest.approx(force, rel=2e-3)
    assert estimate.values["compliance_m_per_n"] == pytest.approx(0.02, abs=2e-4)
    if friction:
        # Its prior, of zero mean, reduces it.
        error = estimate.values["friction"] - friction
        assert abs(error) < 2 * estimate.sigma("friction") < 0.1


@pytest.mark.thorough
@pytest.mark.false_alarm(
    2e-6, "binomial, more than 6 of 30 pushes at 2 %, as of 240; mean squares are 1.6 +- 0.4"
)
@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_its_sigmas_are_honest(friction: float, random: np.random.Generator) -> None:
    in_sigmas = []
    shape = stated_shape(0.05, 0.0, 0.0, 0.3)
    for _ in range(30):
        measurement, state = measured_push(
            still(0.12, 0.0), random, friction=friction, tip_ratio=0.95, sigma=5e-6,
            base_sigma=(5e-6, 5e-6, 5e-5), angles_deg=(4.0, 8.0, 12.0),
        )  # fmt: skip
        estimate = push_fit(of(measurement, shape))
        assert estimate.outcome is Outcome.CONTACT
        truth = {
            "x_c_m": float(state.contact.point[0]),
            "force_n": float(np.linalg.norm(state.contact.force)),
            "compliance_m_per_n": 0.0,
        }
        in_sigmas.append(list(pulls(estimate, truth).values()))
    assert (np.mean(np.square(np.clip(in_sigmas, -4, 4)), axis=0) < 4).all()
    assert np.count_nonzero((np.abs(in_sigmas) > 4).any(axis=1)) <= 6


@pytest.mark.parametrize(("rigid", "first"), [(True, -1.0), (False, 0.0)])
def test_at_first_a_rigid_object_certainly_drags_the_beam_back(rigid: bool, first: float) -> None:
    """Up to 0.5 degrees this beam turns on its thickness; on a soft object it does not."""
    measurement, _ = measured_push(still(0.12, 0.0), angles_deg=(0.3, 4.0, 8.0))
    shape = stated_shape(0.0, 0.0, 0.0, 0.3, rigid_objects=rigid)
    bent = bent_frames(of(measurement, shape))
    assert bent is not None
    rig = replace(measurement.rig, shape=shape)
    push = Push(bent.frames, rig, bent.beam, np.zeros((3, 0)))
    start = np.array([*bent.q, *bent.base, 0.12, ONSET, 0.0, 0.0])
    directed = _sliding(push, bent, start, compliance_sigma=1.0)
    assert list(directed.ratio_matrix[:, 0]) == [first, 1.0, 1.0]


def test_a_clamp_that_gives_adds_to_the_pushing_angle() -> None:
    softness = 0.02
    measurement, state = measured_push(still(0.12, 0.0), sigma=1e-6, base_sigma=(1e-6, 1e-6, 1e-5))
    frames = []
    for frame, degrees in zip(
        (*measurement.earlier, measurement), (3.0, 5.0, 7.0, 9.0, 11.0, 13.0, 15.0), strict=True
    ):
        _, alone = measured_push(still(0.12, 0.0), angles_deg=(degrees,))
        # The clamp turns under its moment: the beam in the image, and the motor by as much.
        turn = softness * -float(alone.base_moment[2]) * BEAM.length / BEAM.flexural_rigidity
        cosine, sine = math.cos(turn), math.sin(turn)
        points = frame.points @ np.array([[cosine, sine], [-sine, cosine]])
        view = View(points, frame.view.sigma_vectors, frame.view.viewpoint)
        assert frame.motor_angle is not None
        frames.append(replace(frame, view=view, motor_angle=frame.motor_angle - turn))
    push = replace(frames[-1], earlier=tuple(frames[:-1]))
    known = BeamShape(softness=softness, covariance=np.diag([1e-12, 0.0, 0.0]))
    estimate = push_fit(of(push, known))
    assert estimate.outcome is Outcome.CONTACT
    # In the mount, in which the clamp has turned.
    x, y, _ = state.contact.point
    assert estimate.values["x_c_m"] == pytest.approx(cosine * x - sine * y, abs=5e-6)
    own = 0.12**3 / (3 * BEAM.flexural_rigidity)
    assert estimate.values["compliance_m_per_n"] == pytest.approx(0.0, abs=1e-3 * own)
    # A clamp taken for rigid looks like a softer object.
    rigid = push_fit(of(push, stated_shape(1e-9, 0.0, 0.0, 0.0)))
    assert rigid.values.get("compliance_m_per_n", 1.0) > 0.01 * own


def cone() -> tuple[PushBeam, Floats]:
    """A cone on a soft clamp, its frames' parameters q, place, friction ratio (3, 3)."""
    measurement, _ = measured_push(still(0.12, 0.0), angles_deg=(4.0, 8.0, 12.0))
    bent = bent_frames(of(measurement, CONE))
    assert bent is not None
    return bent.beam, np.array([bent.q, np.full(3, bent.distance), [0.1, -0.1, 0.2]])


def test_the_gradients_of_contacts_are_their_derivatives() -> None:
    beam, shapes = cone()
    base = beam.prior.mean

    def at(p: Floats) -> ShapeContacts:
        contacts = beam.contacts(p[:3], p[3:6], p[6:9], p[9:])
        assert contacts is not None
        return contacts

    p = np.concatenate([shapes.ravel(), base])
    gradients = at(p)[1]
    for i in range(len(p)):
        step = np.zeros(len(p))
        step[i] = 1e-6 * max(abs(p[i]), 0.01)
        slope = (at(p + step)[0] - at(p - step)[0]) / (2 * step[i])
        # The first nine are of one frame only.
        own = gradients[:, i // 3] * (np.arange(3) == i % 3)
        expected = own if i < 9 else gradients[:, i - 6]
        rounding = 1e-6 * np.abs(expected).max() + 1e-9
        assert slope == pytest.approx(expected, rel=1e-5, abs=rounding)


def test_the_line_at_first_contact_is_that_of_the_bowed_beam() -> None:
    beam, _ = cone()
    problem = beam.frames[0].problem
    mean = problem.mean.copy()
    size = problem.parameters["bow"]
    # The same beam with a bow: three more parameters of its shape, which are fitted.
    bow = np.array([0.02, -0.03, 0.01])
    information = np.zeros((len(mean) + 3, len(mean) + 3))
    with_bow = replace(
        problem,
        beam=IntegratedBeam(2, 3, problem.beam.radius),
        mean=np.insert(mean, size, bow),
        information=information,
        free=np.array([0, 1, 2, 3, 4, *range(size, size + 3)]),
    )
    bowed_beam = PushBeam((beam.frames[0]._replace(problem=with_bow),), beam.rig)
    base = with_bow.mean[bowed_beam.fitted]
    x0, length = 0.13, BEAM.length
    first = bowed_beam.first_touch(x0, base)
    x = x0 / length
    y, slope = bow @ x ** np.arange(2, 5), bow @ (np.arange(2, 5) * x ** np.arange(1, 4))
    assert first.angle == pytest.approx(math.atan(slope))
    width = 1 + x * (mean[3] + mean[4] * (2 * x - 1))
    tangent, normal = np.array([1.0, slope]), np.array([-slope, 1.0])
    root = math.hypot(1, slope)
    place = np.array([x, y]) * length
    assert first.position == pytest.approx(float(place @ tangent) / root)
    thinner = BEAM.radius * (width - 1)
    assert first.height == pytest.approx(float(place @ normal) / root - thinner)
    parameters = np.array([x0, *base])
    for i in range(len(parameters)):
        step = np.zeros(len(parameters))
        step[i] = 1e-6
        after = bowed_beam.first_touch((parameters + step)[0], (parameters + step)[1:])
        before = bowed_beam.first_touch((parameters - step)[0], (parameters - step)[1:])
        change = (np.array(after[:3]) - np.array(before[:3])) / 2e-6
        assert change == pytest.approx(first.gradients[:, i], abs=1e-8)


@pytest.mark.parametrize("shape", [(0.0, 0.002, 0.0, 0.0), (0.0, 0.0, 0.02, 0.0)])
def test_friction_that_no_rig_states_is_fitted_on_any_beam(
    shape: tuple[float, float, float, float],
) -> None:
    measurement, state = measured_push(still(0.12, 0.0), friction=0.3)
    estimate = push_fit_friction(of(measurement, stated_shape(*shape)))
    assert estimate.outcome is Outcome.CONTACT, estimate
    assert abs(estimate.values["x_c_m"] - state.contact.point[0]) < 3 * estimate.sigma("x_c_m")
    assert estimate.values["friction"] == pytest.approx(0.3, abs=3 * estimate.sigma("friction"))
