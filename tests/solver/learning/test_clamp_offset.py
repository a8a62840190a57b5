"""The clamp's offset from the motor's axis, from pushes that the world's rod and motor compute."""

import json
import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import ClampOffset
from solver.instrument.rig_json import read_rig, rig_to_json
from solver.instrument.transforms import turn_about_z
from solver.learning.clamp_offset import ObjectRadius, learn_clamp_offset
from solver.learning.learn import LearnedBeam, learn_beam
from solver.learning.page import summary
from solver.methods.exact_fit import exact_fit
from solver.methods.push_fit import push_fit
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM, columns, rig
from tests.solver.methods.pushes import beam_stiffness, mirrored
from tests.vbaa_bench.mechanics.benches import obstacle
from vbaa_bench.mechanics import pushing
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.surfaces import upright

OFFSET = (0.012, 0.004)
PLACES = (0.09, 0.14, 0.19)
ANGLES = (0.05, 0.1, 0.15)
ONSET = 0.07
SIGMA = 0.01 * 0.51e-3
ENCODER = math.radians(0.01)
RADIUS = 3e-3


@lru_cache
def states(
    place: float, radius: float, offset: tuple[float, float], compliance: float = 0.0
) -> list[tuple[Floats, Floats]]:
    """Columns and the contact point in the world, of a push that the world computes."""
    rod = Rod(BEAM)
    touched = obstacle(rod, place, upright(radius), compliance=compliance)
    steps = [Step(pushing_angle=angle) for angle in ANGLES]
    motor = Motor(point=(-offset[0], -offset[1], 0.0))
    axis = -np.array([*offset, 0.0])
    pushed = pushing.push(rod, motor, [touched], place, steps, 2000)
    return [
        (
            columns(state.centreline),
            turn_about_z(ONSET - angle)[:3, :3] @ (state.contact.point - axis) + axis,
        )
        for state, angle in zip(pushed, ANGLES, strict=True)
    ]


def pushes(
    seed: int = 1,
    radius: float = RADIUS,
    offset: tuple[float, float] = OFFSET,
    compliance: float = 0.0,
) -> list[list[Measurement]]:
    random = generator(__name__, seed)
    result = []
    for place in PLACES:
        frames = []
        pushed = states(place, radius, offset, compliance)
        for (points, _), angle in zip(pushed, ANGLES, strict=True):
            noisy = points + [0.0, 1.0] * (SIGMA * random.standard_normal((len(points), 1)))
            across = np.column_stack([np.zeros(len(points)), np.full(len(points), SIGMA)])
            frames.append(
                Measurement(
                    view=View(noisy, across, np.array([0.12, 0.0, 0.36, 1.0])),
                    base_covariance=np.diag([1e-12, 1e-12, 1e-10]),
                    scale_sigma=0.0,
                    motor_angle=ONSET - angle + ENCODER * random.standard_normal(),
                    rig=rig(encoder=ENCODER),
                )
            )
        result.append(frames)
    return result


@lru_cache
def learned() -> LearnedBeam:
    return learn_beam(pushes(), ObjectRadius(RADIUS, 1e-4))


@pytest.mark.thorough
def test_the_offset_is_learned_and_corrects_contacts_in_the_world() -> None:
    beam = learned()
    assert beam.offset is not None
    assert beam.offset.used
    sigmas = np.sqrt(np.diag(beam.offset.offset.covariance))
    assert (sigmas < [3e-4, 1e-3]).all()
    assert (np.abs(beam.offset.offset.position - OFFSET) < MOST_SIGMAS * sigmas).all()
    assert "clamp's offset from the motor's axis: x 1" in summary(beam, rig(), rig())
    other = pushes(seed=5)[1][-1]
    _, truth = states(PLACES[1], RADIUS, OFFSET)[-1]
    errors = []
    for known in (other.rig, beam.rig(other.rig)):
        estimate = exact_fit(replace(other, rig=known))
        names = ("contact_world_x_m", "contact_world_y_m")
        error = np.array([estimate.values[name] for name in names]) - truth[:2]
        sigma = np.array([estimate.sigma(name) for name in names])
        errors.append((float(np.hypot(*error)), float(np.max(np.abs(error) / sigma))))
    (before, _), (after, in_sigmas) = errors
    assert before > 8e-4
    assert after < 1.5e-4
    assert in_sigmas < MOST_SIGMAS


@pytest.mark.false_alarm(1e-5, "chi-square of twenty values, two components, both sides")
def test_sigmas_of_the_offset_are_those_of_its_errors() -> None:
    frames = [pushes(seed) for seed in range(20)]
    offsets = [learn_clamp_offset(one, one[0][0].rig, ObjectRadius(RADIUS, 0.0)) for one in frames]
    errors = np.array([o.offset.position - OFFSET for o in offsets if o is not None])
    sigmas = np.array([np.sqrt(np.diag(o.offset.covariance)) for o in offsets if o is not None])
    squares = ((errors / sigmas) ** 2).sum(axis=0)
    low, high = chi2.ppf([2.5e-6, 1 - 2.5e-6], len(errors))
    assert (squares > low).all()
    assert (squares < high).all()


def test_an_unknown_radius_leaves_one_direction_uncertain() -> None:
    frames = pushes()
    unknown = learn_clamp_offset(frames, frames[0][0].rig)
    known = learned().offset
    assert unknown is not None
    assert known is not None
    vague, sharp = (np.sqrt(np.diag(one.offset.covariance)) for one in (unknown, known))
    assert vague[1] > 5 * sharp[1]
    assert (np.abs(unknown.offset.position - OFFSET) < 3.5 * vague).all()
    assert "--object-radius" in summary(replace(learned(), offset=unknown), rig(), rig())


def test_a_clamp_on_the_axis_stays_there() -> None:
    frames = pushes(offset=(0.0, 0.0))
    on_axis = learn_clamp_offset(frames, frames[0][0].rig, ObjectRadius(RADIUS, 0.0))
    assert on_axis is not None
    assert on_axis.still
    assert not on_axis.used
    assert "is kept" in summary(replace(learned(), offset=on_axis), rig(), rig())
    # A rig that states it as uncertain learns where it is.
    stated = replace(frames[0][0].rig, clamp_offset=ClampOffset(covariance=np.eye(2) * 1e-6))
    update = learn_clamp_offset(frames, stated, ObjectRadius(RADIUS, 0.0))
    assert update is not None
    assert update.used
    assert np.trace(update.offset.covariance) < 1e-6


def test_objects_that_yield_show_no_offset() -> None:
    """A spring gives way the more the nearer the contact; an offset acts alike everywhere."""
    frames = pushes(compliance=0.1 / beam_stiffness(PLACES[1]))
    moved = learn_clamp_offset(frames, frames[0][0].rig, ObjectRadius(RADIUS, 0.0))
    assert moved is not None
    assert not moved.still
    assert "the objects moved" in summary(replace(learned(), offset=moved), rig(), rig())
    unread = [[replace(frame, motor_angle=None) for frame in push] for push in frames]
    assert learn_clamp_offset(unread, frames[0][0].rig) is None


def test_a_rig_that_deflects_to_the_other_side_has_the_mirrored_offset() -> None:
    frames = [[mirrored(frame) for frame in push] for push in pushes()]
    offset = learn_clamp_offset(frames, frames[0][0].rig, ObjectRadius(RADIUS, 1e-4))
    assert offset is not None
    assert learned().offset is not None
    one, other = offset.offset.position, learned().offset.offset.position  # type: ignore[union-attr]
    assert one == pytest.approx(other * [1, -1], rel=1e-3)


def test_the_offset_does_not_depend_on_where_the_clamp_is_in_sigma_a() -> None:
    base = np.array([0.03, -0.07, 0.0])

    def placed(frame: Measurement) -> Measurement:
        pose = frame.antenna_from_beam.copy()
        pose[:3, 3] = base
        rig = replace(frame.rig, base_position=base)
        return replace(frame, rig=rig, antenna_from_beam=pose)

    frames = [[placed(frame) for frame in push] for push in pushes()]
    offset = learn_clamp_offset(frames, frames[0][0].rig, ObjectRadius(RADIUS, 1e-4))
    assert offset is not None
    assert learned().offset is not None
    expected = learned().offset.offset.position  # type: ignore[union-attr]
    assert offset.offset.position == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("side", [1, -1])
def test_a_push_turns_about_the_axis(side: int) -> None:
    """With the offset the object is rigid; about the clamp it would be of negative compliance."""
    frames = pushes()[0]
    if side < 0:
        frames = [mirrored(frame) for frame in frames]
    push = replace(frames[-1], earlier=tuple(frames[:-1]))

    def about(offset: ClampOffset) -> Measurement:
        known = replace(push.rig, clamp_offset=offset)
        earlier = tuple(replace(frame, rig=known) for frame in push.earlier)
        return replace(push, rig=known, earlier=earlier)

    position = np.array(OFFSET) * [1, side]
    known = push_fit(about(ClampOffset(position)))
    compliance, sigma = known.values["compliance_m_per_n"], known.sigma("compliance_m_per_n")
    assert abs(compliance) < MOST_SIGMAS * sigma
    assert known.values["onset_angle_rad"] == pytest.approx(side * ONSET, abs=1e-3)
    uncertain = push_fit(about(ClampOffset(position, np.eye(2) * 1e-6)))
    assert uncertain.sigma("compliance_m_per_n") > 3 * sigma
    # The frame itself needs no axis.
    alone = push_fit(replace(about(ClampOffset(position)), earlier=()))
    assert uncertain.sigma("x_c_m") == pytest.approx(alone.sigma("x_c_m"))
    assert uncertain.values["x_c_m"] == pytest.approx(alone.values["x_c_m"])
    clamp = push_fit(about(ClampOffset()))
    wrong = clamp.values.get("compliance_m_per_n")
    assert wrong is None or abs(wrong) > 10 * sigma


def test_the_offset_is_kept_in_rig_json(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    offset = ClampOffset(np.array(OFFSET), np.array([[1e-8, 2e-9], [2e-9, 4e-8]]))
    path.write_text(rig_to_json(replace(rig(), clamp_offset=offset)))
    again = read_rig(path)
    assert rig_to_json(again) == path.read_text()
    assert again.clamp_offset.covariance == pytest.approx(offset.covariance)
    document = json.loads(path.read_text())

    def refused(section: str, key: str, value: object, message: str) -> None:
        changed = json.loads(path.read_text())
        changed[section][key] = value
        path_of_mistake = tmp_path / "mistake.json"
        path_of_mistake.write_text(json.dumps(changed))
        with pytest.raises(InputError, match=message):
            read_rig(path_of_mistake)

    refused("base", "clamp_offset_mm", [1.0], "a list of two numbers")
    refused("base", "clamp_offset_covariance_mm2", [[1, 2], [2, 1]], "negative eigenvalues")
    refused("camera", "mount", "world", "one of antenna")
    del document["base"]["clamp_offset_covariance_mm2"]
    document["base"]["clamp_offset_sigma_mm"] = 0.5
    path.write_text(json.dumps(document))
    assert read_rig(path).clamp_offset.covariance == pytest.approx(np.eye(2) * 2.5e-7)
    with pytest.raises(ValueError, match="clamp offset"):
        ClampOffset(np.zeros(3))
