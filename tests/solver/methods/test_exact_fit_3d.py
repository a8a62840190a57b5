"""The beam out of plane C: the world's rod in space, seen by a pinhole."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement, View
from solver.methods.exact_fit import exact_fit
from solver.methods.exact_fit_3d import exact_fit_3d
from tests.consistency import MOST_SIGMAS, nees
from tests.draws import generator
from tests.simulated import BEAM
from tests.simulated_space import (
    BEHIND,
    measured,
    plane_of,
    pushed,
    view,
)

THIRTY = math.radians(30)
TRIALS = 250


@pytest.mark.parametrize("psi_deg", [-50, 0, 30, 60])
@pytest.mark.parametrize("deflection", [0.1, 0.25])
def test_recovers_a_noise_free_beam(psi_deg: float, deflection: float) -> None:
    state = pushed(0.12, deflection, math.radians(psi_deg))
    contact = state.contact
    answer = exact_fit_3d(measured(view(state, tip=True)))
    assert answer.outcome is Outcome.CONTACT
    assert answer.values["psi_rad"] == pytest.approx(plane_of(state), abs=1e-4)
    for axis, place, force in zip("xyz", contact.point, contact.force, strict=True):
        assert answer.values[f"contact_antenna_{axis}_m"] == pytest.approx(place, abs=2e-6)
        assert answer.values[f"force_{axis}_n"] == pytest.approx(force, abs=2e-5)
    assert answer.values["f_n"] == pytest.approx(np.hypot(*contact.force[1:]), rel=1e-4)
    assert answer.values["displacement_z_m"] == pytest.approx(contact.point[2], abs=2e-6)
    # Eq. (27) with the exact lever, right-handed: what the beam exerts on the sensor.
    arm = answer.values["force_n"] * BEAM.length  # a scale to compare on
    moment_y = -state.base_moment[1]
    assert moment_y == pytest.approx(
        answer.values["contact_antenna_z_m"] * answer.values["force_x_n"]
        - answer.values["contact_antenna_x_m"] * answer.values["force_z_n"],
        abs=1e-4 * arm,
    )


def moment(state_moment: float, random: np.random.Generator) -> tuple[float, float]:
    """A reading of the moment sensor, good to 1 %, and its sigma [N m]."""
    return state_moment * (1 + 0.01 * random.standard_normal()), abs(0.01 * state_moment)


def seen(kind: str, seed: int) -> Measurement:
    """The beam at 10 % and 30 degrees with a sigma of 0.05 px, and what helps to tell psi."""
    state, random = pushed(0.12, 0.1, THIRTY), generator(__name__, seed)
    reading = moment(-float(state.base_moment[1]), random)
    if kind == "tip":
        return measured(view(state, tip=True, random=random))
    if kind == "tip from behind":
        return measured(view(state, BEHIND, tip=True, random=random))
    if kind == "tip and moment":
        return measured(view(state, tip=True, random=random), moment=reading)
    return measured(view(state, random=random), moment=reading)


# What the same fit states of noise, in degrees.
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("kind", "sigma_deg"),
    [
        ("tip", 0.18),
        ("tip from behind", 0.05),
        ("tip and moment", 0.146),
        ("moment", 0.25),
    ],
)
def test_psi_attains_its_limit_and_the_covariance_is_honest(kind: str, sigma_deg: float) -> None:
    state = pushed(0.12, 0.1, THIRTY)
    truth = {
        "x_c_m": float(state.contact.point[0]),
        "force_n": float(np.linalg.norm(state.contact.force)),
        "psi_rad": plane_of(state),
    }
    errors, squares = [], []
    for seed in range(TRIALS):
        answer = exact_fit_3d(seen(kind, seed))
        errors.append(answer.values["psi_rad"] - truth["psi_rad"])
        squares.append(nees(answer, truth))
    rmse = math.degrees(float(np.sqrt(np.mean(np.square(errors)))))
    assert rmse == pytest.approx(sigma_deg, rel=0.4)  # 250 trials: 4.5 %
    assert np.mean(squares) == pytest.approx(3.0, abs=1.2)  # 3 +- 0.15


def test_columns_alone_tell_psi_badly_and_say_so() -> None:
    state = pushed(0.12, 0.1, THIRTY)
    answers = [
        exact_fit_3d(measured(view(state, random=generator(__name__, seed)))) for seed in range(160)
    ]
    answered = [one for one in answers if one.values]
    assert len(answered) > 112  # 140 +- 4
    assert all(one.message for one in answers if not one.values)
    # Medians: some errors are far larger, and stated as such.
    psi = np.array([abs(one.values["psi_rad"] - plane_of(state)) for one in answered])
    assert math.radians(3) < np.median(psi) < math.radians(18)  # 7 +- 1 deg
    stated = np.array([one.sigma("psi_rad") for one in answered])
    assert 0.25 < np.median(psi / stated) < 1.2  # 0.6 +- 0.05
    # The place hardly depends on it.
    place = np.array([abs(one.values["x_c_m"] - state.contact.point[0]) for one in answered])
    assert np.median(place) < 0.002 * BEAM.length


def test_a_telecentric_camera_cannot_tell_psi(random: np.random.Generator) -> None:
    state = pushed(0.12, 0.1, THIRTY)
    above = np.array([0.0, 0.0, 1.0, 0.0])
    answer = exact_fit_3d(measured(view(state, above, random=random)))
    assert answer.outcome is Outcome.NOT_IDENTIFIABLE
    # The tip tells how far psi is from zero, but not to which side.
    answer = exact_fit_3d(measured(view(state, above, tip=True, random=random)))
    assert not answer.values
    assert answer.message


@pytest.mark.parametrize("psi_deg", [2.0, 10.0])
def test_a_mirrored_plane_is_part_of_the_uncertainty(psi_deg: float) -> None:
    """Without perspective, psi and -psi are equally likely: the variance is half of (2 psi)^2."""
    state = pushed(0.12, 0.2, math.radians(psi_deg))
    above = np.array([0.0, 0.0, 1.0, 0.0])
    estimate = exact_fit_3d(measured(view(state, above, sigma=1e-6, tip=True)))
    psi = plane_of(state)
    assert abs(estimate.values["psi_rad"]) == pytest.approx(psi, rel=1e-2)
    assert estimate.sigma("psi_rad") == pytest.approx(math.sqrt(2) * psi, rel=2e-2)


@pytest.mark.parametrize(("beside_deg", "has_values"), [(0.0, False), (0.3, False), (2.0, True)])
def test_edge_on_is_said_and_not_guessed(
    beside_deg: float, has_values: bool, random: np.random.Generator
) -> None:
    """A camera in the plane of the bent beam sees a straight one."""
    state = pushed(0.12, 0.1, THIRTY)
    angle = plane_of(state) + math.radians(beside_deg)
    viewpoint = np.array([0.12, 0.36 * math.cos(angle), 0.36 * math.sin(angle), 1.0])
    answer = exact_fit_3d(measured(view(state, viewpoint, tip=True, random=random)))
    assert answer.outcome.has_values == has_values
    if has_values:
        assert abs(answer.values["psi_rad"] - plane_of(state)) < 5 * answer.sigma("psi_rad")


def test_outliers_do_not_turn_the_plane(random: np.random.Generator) -> None:
    state = pushed(0.12, 0.1, THIRTY)
    clean = view(state, tip=True, random=random)
    points = clean.points.copy()
    off = random.random(len(points)) < 0.3
    points[off, 1] += random.uniform(-5e-3, 5e-3, int(off.sum()))
    answer = exact_fit_3d(measured(replace(clean, points=points)))
    assert answer.outcome is Outcome.CONTACT
    assert abs(answer.values["psi_rad"] - plane_of(state)) < MOST_SIGMAS * answer.sigma("psi_rad")


def test_a_flat_strip_is_fitted_in_its_own_plane(random: np.random.Generator) -> None:
    state = pushed(0.12, 0.1, THIRTY)
    seen_strip = measured(view(state, random=random))
    strip = replace(seen_strip, rig=replace(seen_strip.rig, known_psi=plane_of(state)))
    answer = exact_fit(strip)
    assert answer.values["psi_rad"] == pytest.approx(plane_of(state))
    force = float(np.linalg.norm(state.contact.force))
    assert abs(answer.values["force_n"] - force) < MOST_SIGMAS * answer.sigma("force_n")
    assert answer.sigma("force_n") < 0.01 * force


def test_a_beam_that_bends_to_minus_y_leans_the_same_way() -> None:
    state = pushed(0.12, 0.1, THIRTY)
    plain = measured(view(state, tip=True), moment=(-float(state.base_moment[1]), 1e-5))
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    rig = replace(plain.rig, deflects_towards=-1)
    # The same image points, in axes that count y towards -y of Sigma_a: the mirrored world.
    flipped = replace(plain, rig=rig, antenna_from_beam=mirror)
    one, other = exact_fit_3d(plain), exact_fit_3d(flipped)
    assert other.values["force_y_n"] == pytest.approx(-one.values["force_y_n"], rel=1e-6)
    assert other.values["force_z_n"] == pytest.approx(one.values["force_z_n"], rel=1e-6)
    assert other.values["psi_rad"] == pytest.approx(-one.values["psi_rad"], rel=1e-6)


def test_too_few_points_are_said() -> None:
    state = pushed(0.12, 0.1, THIRTY)
    all_points = view(state)
    few = View(all_points.points[:5], all_points.sigma_vectors[:5], all_points.viewpoint)
    answer: Estimate = exact_fit_3d(measured(few))
    assert answer.outcome is Outcome.NOT_IDENTIFIABLE
