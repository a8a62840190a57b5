"""A second peg beyond the first one holds the beam back."""

import functools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from solver.instrument.beam_shape import UNIFORM, BeamShape, stated_shape
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit
from solver.methods.two_contact_fit import two_contact_fit
from tests import tapered
from tests.consistency import nees
from tests.draws import generator
from tests.frictional import misfit
from tests.simulated import BEAM, columns, measurement, pushed_points
from tests.vbaa_bench.mechanics.benches import obstacle
from vbaa_bench.mechanics.pushing import push
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import State

SIGMA = 0.0075 * 0.51e-3  # 0.0075 px
SECOND = 0.19


@functools.cache
def between_pegs(gap: float, angle: float, tip: float = 1.0) -> State:
    pegs = [obstacle(BEAM, 0.1), obstacle(BEAM, SECOND, nu=math.pi, clearance=gap)]
    return push(
        Rod(BEAM, tip_ratio=tip), Motor(), pegs, 0.1, [Step(pushing_angle=angle)], intervals=4000
    )[0]


def noisy(state: State, seed: int, shape: BeamShape = UNIFORM) -> Measurement:
    points = columns(state.centreline)
    noise = SIGMA * generator(__name__, seed).standard_normal(len(points))
    taken = measurement(points + np.outer(noise, [0, 1]), SIGMA, base_sigma=1e-5)
    return replace(taken, rig=replace(taken.rig, shape=shape))


def truths(state: State) -> dict[str, float]:
    inner, outer = state.contacts
    return {
        "x_c_m": inner.point[0],
        "s_c_m": inner.s,
        "force_n": float(np.linalg.norm(inner.force)),
        "force_y_n": inner.force[1],
        "second_s_c_m": outer.s,
        "second_force_n": float(np.linalg.norm(outer.force)),
        "second_force_y_n": outer.force[1],
        "second_contact_antenna_x_m": outer.point[0],
        "second_contact_antenna_y_m": outer.point[1],
    }


def places_and_forces(state: State) -> dict[str, float]:
    names = ("s_c_m", "force_n", "second_s_c_m", "second_force_n")
    return {name: truths(state)[name] for name in names}


def pulls(estimate: Estimate, state: State) -> list[float]:
    return [(estimate.values[k] - v) / estimate.sigma(k) for k, v in truths(state).items()]


@pytest.mark.thorough
@pytest.mark.parametrize(("gap", "angle"), [(1.5e-3, 0.1), (3e-3, 0.5)])
def test_both_contacts_are_within_their_sigmas(gap: float, angle: float) -> None:
    state = between_pegs(gap, angle)
    assert exact_fit(noisy(state, 0)).outcome is Outcome.INVALID
    squares, errors = [], []
    for seed in range(40):
        estimate = two_contact_fit(noisy(state, seed))
        assert estimate.outcome is Outcome.CONTACT
        squares.append(nees(estimate, places_and_forces(state)))
        errors.append(pulls(estimate, state))
    # 2.9 +- 0.4, below the 4 of chi^2: the clamp, which has a prior, is exact here.
    assert 0.8 < np.mean(squares) < 5.8
    assert (np.sqrt(np.mean(np.square(errors), axis=0)) < 2.1).all()


@pytest.mark.thorough
def test_both_contacts_of_a_beam_of_unknown_taper_are_within_their_sigmas() -> None:
    state = between_pegs(3e-3, 0.2, tip=0.8)
    shape = stated_shape(taper=0.2, softness=0.001, section=0.02, friction=0.1)
    squares = []
    for seed in range(8):
        estimate = two_contact_fit(noisy(state, seed, shape))
        assert estimate.outcome is Outcome.CONTACT
        squares.append(nees(estimate, places_and_forces(state)))
        assert np.abs(pulls(estimate, state)).max() < 5
    assert np.mean(squares) < 4  # 0.8 +- 0.3: the taper's error is one sigma of its prior
    # The taper that is not known is in the sigmas.
    known = two_contact_fit(
        noisy(state, 0, BeamShape(np.array([-0.2]), covariance=np.zeros((4, 4))))
    )
    assert estimate.sigma("second_s_c_m") > 2 * known.sigma("second_s_c_m")


@pytest.mark.parametrize("shape", [UNIFORM, stated_shape(0.02, 0.002, 0.02, 0.2)])
def test_a_beam_of_another_taper_than_stated_has_no_second_contact(
    shape: BeamShape, random: np.random.Generator
) -> None:
    bent, tips = tapered.bent(0.3, 0.7, 0.3), []
    for _ in range(5):
        estimate = two_contact_fit(tapered.measured(bent, shape, random))
        assert not estimate.values
        # One fit in ten does not converge: all five in less than one of 1e5 runs.
        if estimate.outcome is not Outcome.NOT_CONVERGED:
            assert estimate.outcome is Outcome.NOT_IDENTIFIABLE
            tip = re.match(r"one contact on a beam with a tip of ([\d.]+)", estimate.message)
            assert tip is not None
            tips.append(float(tip[1]))
    assert tips == pytest.approx([1.3] * len(tips), abs=0.07)  # 1.303 +- 0.008 over 20 seeds
    assert tips


def test_values_of_both_contacts_are_correlated() -> None:
    estimate = two_contact_fit(noisy(between_pegs(1.5e-3, 0.1), 0))
    assert estimate.covariance is not None
    names = list(estimate.values)
    # A second force farther out has to be smaller for the same bend.
    i, j = names.index("second_s_c_m"), names.index("second_force_n")
    correlation = estimate.covariance[i, j] / (
        estimate.sigma("second_s_c_m") * estimate.sigma("second_force_n")
    )
    assert correlation < -0.9
    assert estimate.second_s_c_mm == pytest.approx(1e3 * SECOND, abs=1.0)


def test_one_contact_is_that_of_exact_fit(random: np.random.Generator) -> None:
    points, _, _ = pushed_points(0.12, 0.1)
    noise = SIGMA * random.standard_normal(len(points))
    single = measurement(points + np.outer(noise, [0, 1]), SIGMA, base_sigma=1e-5)
    one, other = exact_fit(single), two_contact_fit(single)
    assert one.values == other.values
    assert one.covariance is not None
    assert np.array_equal(one.covariance, np.asarray(other.covariance))


def test_a_second_contact_that_the_image_does_not_place_is_refused() -> None:
    # The peg has 0.4 % of the load: its force and its place are known only as a product.
    state = between_pegs(4.45e-3, 0.1)
    assert len(state.contacts) == 2
    outcomes = {two_contact_fit(noisy(state, seed)).outcome for seed in range(5)}
    assert outcomes == {Outcome.NOT_IDENTIFIABLE}


def test_a_shape_of_three_forces_is_refused() -> None:
    state = between_pegs(1.5e-3, 0.1)
    points = columns(state.centreline)
    points[:, 1] += 2e-3 * np.maximum(points[:, 0] / 0.24 - 0.9, 0.0)
    points[:, 1] -= 4e-4 * np.sin(math.tau * points[:, 0] / 0.24)
    bent = measurement(points, SIGMA, base_sigma=1e-5)
    estimate = two_contact_fit(bent)
    assert estimate.outcome is Outcome.INVALID
    assert estimate == exact_fit(bent)


def test_friction_is_not_taken_for_a_second_contact(random: np.random.Generator) -> None:
    def height(x: float) -> float:
        def error(y: float) -> float:
            return float(misfit(np.array([x]), np.array([y]), 40.0, 0.12, -0.3)[0][0])

        return float(brentq(error, -0.1, 0.25, xtol=1e-12))

    places = np.arange(3e-3, 0.22, 1e-3)
    points = np.column_stack([places, [height(x) for x in places]])
    noise = SIGMA / 2 * random.standard_normal(len(points))
    rubbed = measurement(points + np.outer(noise, [0, 1]), SIGMA / 2, base_sigma=1e-5)
    single, estimate = exact_fit(rubbed), two_contact_fit(rubbed)
    assert single.chi2 is not None
    assert single.dof is not None
    assert single.chi2 / single.dof > 2
    assert "second_s_c_m" not in estimate.values
    assert estimate.outcome is single.outcome
