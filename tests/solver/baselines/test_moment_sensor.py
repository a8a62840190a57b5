import dataclasses

import numpy as np
import pytest

from solver.baselines.moment_sensor import moment_sensor
from solver.beams.linear import unit_deflection
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from tests.inclined import VIEWPOINT, inclined, on_plane_c, pushed
from tests.simulated import BEAM, columns

EI = BEAM.flexural_rigidity
FINE = 1e-6


@pytest.mark.parametrize("psi_deg", [-75, -50, -20, 0, 35, 60, 75])
def test_finds_the_plane_at_any_inclination(psi_deg: float) -> None:
    psi = np.radians(psi_deg)
    points, truth = pushed(0.15, 0.1, psi)
    answer = moment_sensor(inclined(points, FINE, moment_y=truth["moment_y"], moment_sigma=1e-6))
    assert answer.values["psi_rad"] == pytest.approx(psi, abs=np.radians(0.2))
    # What is left is the bias of linear theory in the mean of pairs.
    assert answer.values["x_c_m"] == pytest.approx(truth["x_c_m"], abs=0.01 * BEAM.length)
    for name in ("contact_antenna_y_m", "contact_antenna_z_m", "force_y_n", "force_z_n"):
        assert answer.values[name] == pytest.approx(truth[name], rel=0.05, abs=1e-9)
    assert answer.iterations is not None
    assert answer.iterations <= 8


def linear(x_c: float, load: float, psi: float) -> tuple[Floats, float]:
    """Columns on C of a linear beam in the plane psi, and the moment that its force makes."""
    x = np.linspace(0, 0.24, 40_001)
    on_c = on_plane_c(np.column_stack([x, load * unit_deflection(x, x_c)]), psi, VIEWPOINT)
    force, theta, y_c = 6 * EI * load, np.arctan(3 * load * x_c**2), 2 * load * x_c**3
    lever = x_c * np.cos(theta) + y_c * np.sin(theta)
    # (27), right-handed, with the force's true lever
    return columns(np.column_stack([x, on_c, x])), float(-force * np.sin(psi) * lever)


def test_the_balance_holds_to_rounding_on_a_linear_beam() -> None:
    psi, x_c, load = 0.8, 0.12, 1.5
    points, reading = linear(x_c, load, psi)
    y_c = 2 * load * x_c**3
    answer = moment_sensor(inclined(points, 1e-9, moment_y=reading, moment_sigma=1e-9))
    assert answer.values["psi_rad"] == pytest.approx(psi, abs=1e-6)
    assert answer.values["x_c_m"] == pytest.approx(x_c, abs=1e-6)
    # (28), (29)
    assert answer.values["displacement_y_m"] == pytest.approx(y_c * np.cos(psi), rel=1e-5)
    assert answer.values["displacement_z_m"] == pytest.approx(y_c * np.sin(psi), rel=1e-5)


def test_a_mirrored_rig_mirrors_the_answer() -> None:
    points, truth = pushed(0.15, 0.1, 0.6)
    seen = inclined(points, FINE, moment_y=truth["moment_y"], moment_sigma=1e-6)
    other = dataclasses.replace(seen, antenna_from_beam=np.diag([1.0, -1.0, 1.0, 1.0]))
    one, two = moment_sensor(seen).values, moment_sensor(other).values
    # y and with it the inclination change their signs; x, z and the moment about y do not.
    for name, sign in (("psi_rad", -1), ("force_y_n", -1), ("force_z_n", 1), ("x_c_m", 1)):
        assert two[name] == pytest.approx(sign * one[name], rel=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("base_sigma", [0.0, 2e-8])
def test_its_covariance_is_that_of_its_sources(
    base_sigma: float, random: np.random.Generator
) -> None:
    # Noise so small that the pairs' mean is linear in it.
    noise, psi = 1e-7, 0.7
    points, moment = linear(0.15, 1.9, psi)
    points = points[::5]  # the time grows with the square of their number
    sensor = 0.01 * abs(moment)
    found, stated = [], []
    names = ["x_c_m", "force_n", "psi_rad", "contact_antenna_z_m", "force_y_n", "force_z_n"]
    for _ in range(300):
        dx, dy, tilt = base_sigma * random.standard_normal(3) * [1, 1, 10]
        noisy = points + np.column_stack([np.full(len(points), dx), dy + tilt * points[:, 0]])
        noisy[:, 1] += noise * random.standard_normal(len(points))
        reading = moment + sensor * random.standard_normal()
        seen = inclined(noisy, noise, base_sigma=base_sigma, moment_y=reading, moment_sigma=sensor)
        answer = moment_sensor(seen)
        found.append([answer.values[name] for name in names])
        stated.append([answer.sigma(name) for name in names])
    scatter = np.std(found, axis=0, ddof=1)
    # 300 trials: +-4 % per sigma. Neighbours that seem to err together widen it, never narrow it.
    told = np.mean(stated, axis=0) / scatter
    assert (told > 0.75).all()
    assert (told < 2.0).all()


def test_what_it_cannot_answer_is_said() -> None:
    points, truth = pushed(0.15, 0.1, 0.6)
    silent = moment_sensor(inclined(points, FINE))
    assert silent.outcome is Outcome.INVALID
    assert "moment sensor" in silent.message
    moment = truth["moment_y"]
    few = moment_sensor(inclined(points[:20], FINE, moment_y=moment, moment_sigma=1e-4))
    assert few.outcome is Outcome.NOT_IDENTIFIABLE
    unweighted = moment_sensor(inclined(points, FINE, moment_y=moment))
    assert unweighted.outcome is Outcome.INVALID
    assert "no sigma" in unweighted.message
    straight = points * [1, 0]
    resting = moment_sensor(inclined(straight, FINE, moment_y=0.0, moment_sigma=1e-4))
    assert resting.outcome is Outcome.NO_CONTACT
    hidden = moment_sensor(inclined(straight, FINE, moment_y=-5e-3, moment_sigma=1e-4))
    assert hidden.outcome is Outcome.EDGE_ON
    same = moment_sensor(inclined(np.full((60, 2), 0.1), FINE, moment_y=1e-3, moment_sigma=1e-4))
    assert not same.values
