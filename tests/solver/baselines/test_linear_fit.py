import dataclasses

import numpy as np
import pytest

from solver.baselines.linear_fit import linear_fit
from solver.beams.linear import unit_deflection
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from tests.consistency import nees
from tests.draws import generator
from tests.inclined import inclined, pushed
from tests.simulated import BEAM, measurement, pushed_points

SIGMA = 0.05 * 0.51e-3
EI = BEAM.flexural_rigidity
X = np.arange(0.003, 0.24, 0.51e-3)


def linear_beam(x_c: float, deflection: float = 0.1) -> tuple[Floats, float]:
    load = deflection * 0.24 / float(unit_deflection(0.24, x_c))
    return load * unit_deflection(X, x_c), load


@pytest.mark.parametrize("x_c", [0.01, 0.06, 0.12, 0.2352])
@pytest.mark.parametrize("deflection", [1e-4, 0.1])
def test_is_exact_on_a_noise_free_linear_beam(x_c: float, deflection: float) -> None:
    y, load = linear_beam(x_c, deflection)
    answer = linear_fit(measurement(np.column_stack([X, y]), 1e-9))
    assert answer.values["x_c_m"] == pytest.approx(x_c, rel=1e-9)
    assert answer.values["force_n"] == pytest.approx(6 * EI * load, rel=1e-8)
    assert answer.values["displacement_y_m"] == pytest.approx(2 * load * x_c**3, rel=1e-9)  # (28)


@pytest.mark.parametrize(
    ("deflection", "bias_pct"),
    [(0.05, (0.05, 0.12, 0.28)), (0.1, (0.21, 0.49, 1.15)), (0.2, (0.9, 2.1, 5.2))],
)
def test_its_bias_on_the_exact_beam_is_that_of_linear_theory(
    deflection: float, bias_pct: tuple[float, float, float]
) -> None:
    for place, bias in zip((0.09, 0.15, 0.21), bias_pct, strict=True):
        # The object stands at `place`; the contact distance is a little less.
        points, x_c, _ = pushed_points(place, deflection)
        answer = linear_fit(measurement(points, SIGMA))
        found = 100 * (answer.values["x_c_m"] - x_c) / BEAM.length
        assert found == pytest.approx(bias, rel=0.15, abs=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("x_c", [0.06, 0.21])
@pytest.mark.parametrize("base_sigma", [0.0, 2e-5])
def test_its_covariance_is_honest(
    x_c: float, base_sigma: float, random: np.random.Generator
) -> None:
    y, load = linear_beam(x_c)
    squares, places = [], []
    for _ in range(100):
        dx, dy, tilt = base_sigma * random.standard_normal(3) * [1, 1, 10]
        y = load * unit_deflection(X - dx, x_c) + dy + tilt * X
        y = y + SIGMA * random.standard_normal(len(X))
        answer = linear_fit(measurement(np.column_stack([X, y]), SIGMA, base_sigma))
        squares.append(nees(answer, {"x_c_m": x_c, "force_n": 6 * EI * load}))
        y_c = 2 * load * x_c**3 + dy + tilt * x_c
        places.append(nees(answer, {"contact_antenna_y_m": y_c}))
    # chi^2 of two degrees of freedom, and of one: 100 trials, +- 10 % and +- 14 %. The sigmas are
    # widened by the noise's own correlation, a few per cent to a third: never optimistic.
    assert 0.6 < np.mean(squares) < 3.6
    assert 0.15 < np.mean(places) < 2.1


def test_chi2_has_the_stated_degrees_of_freedom() -> None:
    """Its mean over white noise, the number of degrees of freedom, is a sum over all errors."""
    base_sigma = 2e-5
    x = np.linspace(0.02, 0.23, 9)
    load = 0.024 / float(unit_deflection(0.24, 0.12))
    total, dof = 0.0, 0
    for error in np.eye(3 + len(x)):
        dx, dy, tilt = base_sigma * error[:3] * [1, 1, 10]
        y = load * unit_deflection(x - dx, 0.12) + dy + tilt * x + SIGMA * error[3:]
        estimate = linear_fit(measurement(np.column_stack([x, y]), SIGMA, base_sigma))
        assert estimate.chi2 is not None
        assert estimate.dof is not None
        total, dof = total + estimate.chi2, estimate.dof
    assert dof == 7
    assert total == pytest.approx(dof, rel=1e-2)


def test_the_rigs_tolerances_enter_the_covariance() -> None:
    y, load = linear_beam(0.12)
    plain = measurement(np.column_stack([X, y]), 1e-9, scale_sigma=1e-3)
    tolerances = dataclasses.replace(
        plain.rig.tolerances, flexural_rigidity=0.02 * EI, encoder=1e-3
    )
    rig = dataclasses.replace(plain.rig, tolerances=tolerances)
    answer = linear_fit(dataclasses.replace(plain, rig=rig))
    force = 6 * EI * load
    assert answer.sigma("x_c_m") == pytest.approx(1e-3 * 0.12, rel=1e-3)
    assert answer.sigma("force_n") == pytest.approx(force * np.hypot(0.02, 2e-3), rel=1e-3)
    # An encoder that errs turns the contact about the clamp.
    assert answer.sigma("contact_world_y_m") == pytest.approx(
        np.hypot(1e-3 * 0.12, 1e-3 * answer.values["y_c_m"]), rel=1e-2
    )


@pytest.mark.parametrize("psi_deg", [-60.0, 35.0])
def test_a_known_plane_is_un_projected_first(psi_deg: float) -> None:
    psi = np.radians(psi_deg)
    points, truth = pushed(0.15, 0.05, psi)
    answer = linear_fit(inclined(points, SIGMA, known_psi=psi))
    assert answer.values["x_c_m"] == pytest.approx(truth["x_c_m"], abs=2e-3 * BEAM.length)
    for name in ("contact_antenna_y_m", "contact_antenna_z_m", "force_y_n", "force_z_n"):
        assert answer.values[name] == pytest.approx(truth[name], rel=0.01)


def test_turned_motor_carries_the_contact_into_the_world() -> None:
    y, _ = linear_beam(0.12)
    turned = dataclasses.replace(measurement(np.column_stack([X, y]), SIGMA), motor_angle=np.pi / 2)
    values = linear_fit(turned).values
    assert values["contact_world_x_m"] == pytest.approx(-values["contact_antenna_y_m"])
    assert values["contact_world_y_m"] == pytest.approx(values["contact_antenna_x_m"])
    encoderless = linear_fit(dataclasses.replace(turned, motor_angle=None)).values
    assert "contact_world_x_m" not in encoderless


def outcome(points: Floats) -> Estimate:
    answer = linear_fit(measurement(points, SIGMA, 1e-6))
    assert answer.outcome is not Outcome.CONTACT
    assert answer.outcome.has_values or not answer.values
    return answer


def test_what_is_no_point_contact_is_said(random: np.random.Generator) -> None:
    y, _ = linear_beam(0.15)
    assert outcome(np.empty((0, 2))).outcome is Outcome.NOT_IDENTIFIABLE
    assert outcome(np.full((60, 2), 0.1)).outcome is not Outcome.CONTACT
    assert outcome(np.column_stack([X, -y])).outcome is Outcome.INVALID
    noise = SIGMA * random.standard_normal(len(X))
    assert outcome(np.column_stack([X, noise])).outcome is Outcome.NO_CONTACT
    assert outcome(np.column_stack([X, X**2])).outcome is not Outcome.CONTACT  # no end to the arc
    stretched = np.column_stack([X, y]) * 1.7
    assert outcome(stretched).outcome is Outcome.INVALID


def test_order_of_the_points_does_not_matter() -> None:
    y, _ = linear_beam(0.1)
    points = np.column_stack([X, y + SIGMA * generator(__name__, 2).standard_normal(len(X))])
    one = linear_fit(measurement(points, SIGMA))
    other = linear_fit(measurement(generator(__name__, 3).permutation(points), SIGMA))
    assert other.values["x_c_m"] == pytest.approx(one.values["x_c_m"], abs=1e-12)
    assert other.sigma("x_c_m") == pytest.approx(one.sigma("x_c_m"), rel=1e-6)
