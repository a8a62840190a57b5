import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.baselines.two_point import contact_distance, two_point
from solver.beams.linear import ratio_slope, unit_deflection
from solver.instrument.estimate import Estimate, Outcome
from tests.draws import generator
from tests.inclined import VIEWPOINT, inclined, on_plane_c
from tests.simulated import BEAM, columns, measurement, pushed_points

EI = BEAM.flexural_rigidity
PLACES = st.floats(0.004, 0.24)


def one(x1: float, y1: float, x2: float, y2: float) -> float:
    return float(contact_distance(*(np.array([v]) for v in (x1, y1, x2, y2)))[0])


def rho(x1: float, x2: float, x_c: float) -> float:
    return float(unit_deflection(x2, x_c) / unit_deflection(x1, x_c))


@given(PLACES, PLACES, PLACES, st.floats(1e-3, 10.0))
def test_every_pair_on_a_linear_beam_gives_its_contact(
    x1: float, x2: float, x_c: float, force: float
) -> None:
    x1, x2 = sorted((x1, x2))
    if x2 < 1.05 * x1:
        return
    y1, y2 = (float(force / (6 * EI) * unit_deflection(x, x_c)) for x in (x1, x2))
    # rho is flat where both points lie far beyond the contact: rounding grows by 1 / rho'.
    step = 1e-5 * x_c
    slope = (rho(x1, x2, x_c + step) - rho(x1, x2, x_c - step)) / (2 * step)
    assert one(x1, y1, x2, y2) == pytest.approx(x_c, abs=1e-14 * rho(x1, x2, x_c) / slope + 1e-12)


def test_equals_the_printed_equations() -> None:
    f, x_c = 0.05, 0.12

    def y(x: float) -> float:
        return float(f / (6 * EI) * unit_deflection(x, x_c))

    x1, x2 = 0.05, 0.10  # both curved: (15), and (14) for the force
    y1, y2 = y(x1), y(x2)
    printed = (x1**3 * y2 - x2**3 * y1) / (3 * (x1**2 * y2 - x2**2 * y1))
    assert one(x1, y1, x2, y2) == pytest.approx(printed, rel=1e-12)
    force = 6 * EI * (x2**2 * y1 - x1**2 * y2) / (x1**2 * x2**2 * (x2 - x1))
    assert force == pytest.approx(f, rel=1e-12)
    x1, x2 = 0.15, 0.23  # both straight: (19), and (18) with its last factor squared
    y1, y2 = y(x1), y(x2)
    printed = 3 * (x1 * y2 - x2 * y1) / (y2 - y1)
    assert one(x1, y1, x2, y2) == pytest.approx(printed, rel=1e-12)
    force = 2 * EI * (y2 - y1) ** 3 / (9 * (x2 - x1) * (x1 * y2 - x2 * y1) ** 2)
    assert force == pytest.approx(f, rel=1e-12)
    x1, x2 = 0.06, 0.20  # one each: the root of (20)
    y1, y2 = y(x1), y(x2)
    c = one(x1, y1, x2, y2)
    cubic = y1 * c**3 - 3 * x2 * y1 * c**2 + 3 * x1**2 * y2 * c - x1**3 * y2
    assert c == pytest.approx(x_c, rel=1e-12)
    assert abs(cubic) < 1e-12 * y1 * c**3


@given(PLACES, PLACES, st.floats(0.01, 40.0))
def test_a_pair_without_a_solution_gives_none(x1: float, x2: float, rho: float) -> None:
    x1, x2 = sorted((x1, x2))
    if x2 < 1.05 * x1:
        return
    r = x2 / x1
    x_c = one(x1, 1e-3, x2, 1e-3 * rho)
    assert np.isnan(x_c) == (not r < rho < r**2)


def linear_measurement(x_c: float, force: float, noise: float, seed: int = 0) -> Estimate:
    x = np.arange(0.003, 0.24, 0.51e-3)
    y = force / (6 * EI) * unit_deflection(x, x_c)
    y = y + noise * generator(__name__, seed).standard_normal(len(x))
    return two_point(measurement(np.column_stack([x, y]), max(noise, 1e-9)))


@pytest.mark.parametrize("x_c", [0.06, 0.12, 0.21])
def test_is_exact_on_a_noise_free_linear_beam(x_c: float) -> None:
    answer = linear_measurement(x_c, 0.05, noise=0.0)
    assert answer.values["x_c_m"] == pytest.approx(x_c, rel=1e-9)
    assert answer.values["force_n"] == pytest.approx(0.05, rel=1e-9)


def test_its_covariance_is_that_of_the_noise() -> None:
    # Noise small enough that every pair keeps its solution: the mean is then linear in it.
    names = ["x_c_m", "force_n", "y_c_m", "contact_antenna_y_m"]
    answers = [linear_measurement(0.12, 0.05, 2e-8, seed) for seed in range(60)]
    found = np.array([[answer.values[name] for name in names] for answer in answers])
    stated = np.mean([[answer.sigma(name) for name in names] for answer in answers], axis=0)
    assert found.std(axis=0, ddof=1) == pytest.approx(stated, rel=0.5)  # 60 trials: +-9 % per sigma


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@given(PLACES, PLACES, PLACES, PLACES)
def test_the_ratio_grows_strictly_from_r_to_its_square(
    x1: float, x2: float, one: float, other: float
) -> None:
    x1, x2 = sorted((x1, x2))
    one, other = sorted((one, other))
    if x2 < 1.05 * x1 or other < 1.01 * one:
        return
    low, high = rho(x1, x2, one), rho(x1, x2, other)
    assert x2 / x1 < low < high < (x2 / x1) ** 2
    assert rho(x1, x2, 1e-9) == pytest.approx(x2 / x1)
    assert rho(x1, x2, 1e9) == pytest.approx((x2 / x1) ** 2)
    step = 1e-6 * one
    slope = (rho(x1, x2, one + step) - rho(x1, x2, one - step)) / (2 * step)
    assert ratio_slope(x1, x2, one) == pytest.approx(slope, rel=1e-4, abs=1e-9 / one)


@pytest.mark.parametrize("psi_deg", [-60.0, 30.0, 70.0])
def test_a_flat_strip_is_un_projected_first(psi_deg: float) -> None:
    psi = np.radians(psi_deg)
    x = np.linspace(0, 0.24, 40_001)
    load, x_c = 1.5, 0.12
    on_c = on_plane_c(np.column_stack([x, load * unit_deflection(x, x_c)]), psi, VIEWPOINT)
    points = columns(np.column_stack([x, on_c, x]))
    values = two_point(inclined(points, 1e-8, known_psi=psi)).values
    y_c = 2 * load * x_c**3
    expected = {
        "x_c_m": x_c,
        "force_n": 6 * EI * load,
        "displacement_y_m": y_c * np.cos(psi),  # (28)
        "displacement_z_m": y_c * np.sin(psi),  # (29)
        "contact_antenna_z_m": y_c * np.sin(psi),  # (5)
        "force_y_n": 6 * EI * load * np.cos(psi),
        "force_z_n": 6 * EI * load * np.sin(psi),
    }
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, rel=1e-5)


def test_noise_biases_it_as_published(random: np.random.Generator) -> None:
    # 5 % deflection, 0.3 px, x_c = 230 mm: pairs beyond the tip are refused, and what is left lies
    # far inside. A large error, and an answer all the same.
    x = np.arange(0.003, 0.24, 0.51e-3)
    y = 0.012 / float(unit_deflection(0.24, 0.23)) * unit_deflection(x, 0.23)
    errors = []
    for _ in range(10):
        noise = 0.3 * 0.51e-3 * random.standard_normal(len(x))
        answer = two_point(measurement(np.column_stack([x, y + noise]), 0.3 * 0.51e-3))
        errors.append(100 * (answer.values["x_c_m"] - 0.23) / BEAM.length)
    assert -45 < np.mean(errors) < -10


def test_ratios_out_of_range_and_repeated_points_are_no_numbers() -> None:
    x = np.linspace(0.01, 0.23, 200)
    for y in (x, 0.3 * x, 5 * x**2, 50 * x**3, np.full_like(x, 0.01)):
        answer = two_point(measurement(np.column_stack([x, y]), 1e-6))
        assert not answer.values
        assert answer.message
    same = two_point(measurement(np.full((100, 2), 0.05), 1e-6))
    assert not same.values
    once = linear_measurement(0.12, 0.05, 0.0)
    x = np.arange(0.003, 0.24, 0.51e-3).repeat(2)
    y = 0.05 / (6 * EI) * unit_deflection(x, 0.12)
    twice = two_point(measurement(np.column_stack([x, y]), 1e-9))
    assert twice.values["x_c_m"] == pytest.approx(once.values["x_c_m"], rel=1e-9)


def test_too_few_pairs_identify_nothing() -> None:
    points = np.column_stack([np.linspace(0.01, 0.2, 20), np.linspace(0.2, 0.01, 20)])
    assert two_point(measurement(points, 1e-5)).outcome is Outcome.NOT_IDENTIFIABLE
    assert two_point(measurement(np.empty((0, 2)), 1e-5)).outcome is Outcome.NOT_IDENTIFIABLE
    # Many points, and none far enough from another.
    short, _, _ = pushed_points(0.15, 0.1)
    near = short[short[:, 0] < 0.05]
    answer = two_point(measurement(near, 1e-6))
    assert answer.outcome is Outcome.NOT_IDENTIFIABLE
    assert answer.message


def test_a_displaced_clamp_enters_the_covariance() -> None:
    force, x_c, sigma = 0.05, 0.12, 1e-4
    x = np.arange(0.003, 0.235, 0.51e-3)

    def answer(displaced: float, base_sigma: float = 0.0) -> Estimate:
        y = force / (6 * EI) * unit_deflection(x - displaced, x_c)
        return two_point(measurement(np.column_stack([x, y]), 1e-9, base_sigma))

    step = 1e-7
    ahead, behind = answer(step).values, answer(-step).values
    by_x = {name: (ahead[name] - behind[name]) / (2 * step) for name in ahead}
    # Known exactly but for its place along the beam, the clamp adds just these.
    stated = answer(0.0)
    rig_only = measurement(np.column_stack([x, np.zeros_like(x)]), 1e-9).base_covariance.copy()
    rig_only[0, 0] = sigma**2
    points = np.column_stack([x, force / (6 * EI) * unit_deflection(x, x_c)])
    vague = two_point(dataclasses.replace(measurement(points, 1e-9), base_covariance=rig_only))
    for name in ("x_c_m", "force_n"):
        added = np.sqrt(vague.sigma(name) ** 2 - stated.sigma(name) ** 2)
        assert added == pytest.approx(abs(by_x[name]) * sigma, rel=0.1)
