import math
from dataclasses import replace

import numpy as np
import pytest

from solver.baselines.force_sensor import force_sensor
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement, View
from tests.consistency import nees
from tests.simulated import BEAM, rig
from tests.solver.methods.pushes import sensing_rig, with_tolerances
from vbaa_bench.mechanics.planar import push
from vbaa_bench.mechanics.state import State

FORCE_SIGMA, MOMENT_SIGMA = 1e-3, 1e-4


def reading(
    force: Floats, moment: Floats, random: np.random.Generator | None = None
) -> Measurement:
    """What the clamp exerts on the beam, read with noise; no camera."""
    if random is not None:
        force = force + FORCE_SIGMA * random.standard_normal(3)
        moment = moment + MOMENT_SIGMA * random.standard_normal(3)
    nothing = np.zeros((0, 2))
    return Measurement(
        view=View(nothing, nothing, np.array([0.12, 0.0, 0.36, 1.0])),
        base_covariance=1e-18 * np.eye(3),
        scale_sigma=0.0,
        motor_angle=0.05,
        rig=sensing_rig(FORCE_SIGMA, MOMENT_SIGMA),
        base_force=(float(force[0]), float(force[1]), float(force[2])),
        base_moment=(float(moment[0]), float(moment[1]), float(moment[2])),
    )


def pushed(distance: float, degrees: float) -> State:
    return push(BEAM, distance, pushing_angle=math.radians(degrees))


def turned(vector: Floats, psi: float) -> Floats:
    """A vector of a push in plane C, carried into a plane inclined by psi."""
    x, y, z = vector
    return np.array(
        [x, y * math.cos(psi) - z * math.sin(psi), y * math.sin(psi) + z * math.cos(psi)]
    )


@pytest.mark.parametrize("distance", [0.02, 0.12, 0.2])
@pytest.mark.parametrize("degrees", [1.0, 8.0, 25.0])
@pytest.mark.parametrize("psi", [0.0, 0.9, -1.2])
def test_recovers_what_the_world_exerts(distance: float, degrees: float, psi: float) -> None:
    state = pushed(distance, degrees)
    answer = force_sensor(reading(turned(state.base_force, psi), turned(state.base_moment, psi)))
    assert answer.outcome.has_values
    values = answer.values
    x, y, _ = state.contact.point
    assert values["x_c_m"] == pytest.approx(x, abs=1e-7)
    assert values["y_c_m"] == pytest.approx(y, abs=1e-7)
    assert values["s_c_m"] == pytest.approx(state.contact.s, abs=1e-7)
    assert values["force_n"] == pytest.approx(float(np.linalg.norm(state.base_force)), rel=1e-6)
    assert values["psi_rad"] == pytest.approx(psi, abs=1e-6)
    in_antenna = [values[f"contact_antenna_{axis}_m"] for axis in "xyz"]
    assert in_antenna == pytest.approx(list(turned(np.array([x, y, 0.0]), psi)), abs=1e-7)
    force = [values[f"force_{axis}_n"] for axis in "xyz"]
    assert force == pytest.approx(list(turned(-state.base_force, psi)), abs=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize(("distance", "degrees"), [(0.06, 2.0), (0.12, 10.0), (0.18, 15.0)])
def test_its_covariance_is_honest(
    distance: float, degrees: float, random: np.random.Generator
) -> None:
    state = pushed(distance, degrees)
    true = {
        "x_c_m": float(state.contact.point[0]),
        "force_n": float(np.linalg.norm(state.base_force)),
        "psi_rad": 0.0,
    }
    squares, scatter = [], []
    for _ in range(600):
        answer = force_sensor(reading(state.base_force, state.base_moment, random))
        assert answer.outcome is Outcome.CONTACT
        squares.append(nees(answer, true))
        assert answer.chi2 is not None
        scatter.append(answer.chi2)
    # chi^2 of three degrees of freedom, 600 trials: 3 +- 0.1.
    assert 2.3 < np.mean(squares) < 3.7
    assert 2.3 < np.mean(scatter) < 3.7


def test_a_mirrored_rig_answers_the_same_contact() -> None:
    state = pushed(0.12, 10.0)
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    seen = reading(mirror[:3, :3] @ state.base_force, -mirror[:3, :3] @ state.base_moment)
    other = replace(seen, antenna_from_beam=mirror, rig=replace(seen.rig, deflects_towards=-1))
    one, two = force_sensor(reading(state.base_force, state.base_moment)), force_sensor(other)
    assert two.values["x_c_m"] == pytest.approx(one.values["x_c_m"], abs=1e-9)
    assert two.values["contact_antenna_y_m"] == pytest.approx(-one.values["contact_antenna_y_m"])
    assert two.values["force_y_n"] == pytest.approx(-one.values["force_y_n"])


def test_the_flexural_rigidity_matters_only_to_the_bent_shape() -> None:
    state = pushed(0.12, 15.0)
    sharp = force_sensor(reading(state.base_force, state.base_moment))
    known = with_tolerances(
        reading(state.base_force, state.base_moment),
        flexural_rigidity=0.1 * BEAM.flexural_rigidity,
    )
    vague = force_sensor(known)
    assert vague.sigma("force_n") == pytest.approx(sharp.sigma("force_n"), rel=1e-6)
    assert vague.sigma("y_c_m") > 5 * sharp.sigma("y_c_m")


def test_noise_alone_is_no_contact(random: np.random.Generator) -> None:
    outcomes = [force_sensor(reading(np.zeros(3), np.zeros(3), random)).outcome for _ in range(500)]
    assert all(outcome is Outcome.NO_CONTACT for outcome in outcomes)


def test_without_a_sensor_it_says_so() -> None:
    state = pushed(0.12, 10.0)
    seen = reading(state.base_force, state.base_moment)
    for blind in (
        replace(seen, base_force=None),
        replace(seen, base_moment=None),
        replace(seen, rig=rig()),
    ):
        answer = force_sensor(blind)
        assert answer.outcome is Outcome.INVALID
        assert "sensor" in answer.message


def test_what_no_frictionless_contact_exerts_is_refused() -> None:
    state = pushed(0.12, 10.0)
    force, moment = state.base_force, state.base_moment
    rubbing = force + 0.3 * np.linalg.norm(force) * np.array([1.0, 0.0, 0.0])
    beyond_tip = moment * 2.5
    from_behind = (-force * [-1, 1, 1], -moment)
    for bad in ((rubbing, moment), (force, beyond_tip), from_behind):
        answer = force_sensor(reading(*bad))
        assert answer.outcome is Outcome.INVALID
        assert answer.message


def test_a_contact_near_the_tip_is_flagged() -> None:
    state = pushed(0.235, 10.0)
    assert force_sensor(reading(state.base_force, state.base_moment)).outcome is Outcome.TIP_CONTACT
