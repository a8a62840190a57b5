"""The exact fit where the rig states that the beam may be tapered, or objects have friction."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from solver.fitting.uniform_estimate import uniform_estimate
from solver.instrument.beam_shape import BeamShape, stated_shape
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import View
from solver.methods.exact_fit import exact_fit
from tests.consistency import MOST_SIGMAS
from tests.simulated import BEAM, measurement, pushed_points
from tests.tapered import SIGMA, bent, measured

MAYBE_TAPERED = stated_shape(taper=0.4, softness=0.0, section=0.0, friction=0.0)


def pulls(estimate: Estimate, truth: dict[str, float]) -> list[float]:
    return [(estimate.values[name] - value) / estimate.sigma(name) for name, value in truth.items()]


@pytest.mark.thorough
@pytest.mark.false_alarm(6e-7, "chi-square, three values, 1e-7 on either side")
@pytest.mark.parametrize("taper", [-0.4, 0.0, 0.25])
@pytest.mark.parametrize(("place", "load"), [(0.4, 3.0), (0.6, 1.2), (0.85, 0.25)])
def test_a_beam_of_unknown_taper(
    taper: float, place: float, load: float, random: np.random.Generator
) -> None:
    beam = bent(taper, place, load)
    truth = {
        "x_c_m": float(beam.points[0, 0]),
        "s_c_m": place * BEAM.length,
        "force_n": load * BEAM.flexural_rigidity / BEAM.length**2,
    }
    estimates = [exact_fit(measured(beam, MAYBE_TAPERED, random)) for _ in range(20)]
    assert all(estimate.outcome is Outcome.CONTACT for estimate in estimates)
    squares = np.mean(np.square([pulls(estimate, truth) for estimate in estimates]), axis=0)
    # Means of 20 squares of standard normal values.
    low, high = chi2.ppf([1e-7, 1 - 1e-7], 20) / 20
    assert (squares > low).all()
    assert (squares < high).all()
    assert np.mean([estimate.sigma("x_c_m") for estimate in estimates]) < 0.002 * BEAM.length


def test_a_beam_that_is_known_to_be_uniform_is_estimated_as_before() -> None:
    points, x_c, force = pushed_points(0.14, 0.1)
    taken = measurement(points, SIGMA)
    known = replace(taken, rig=replace(taken.rig, shape=stated_shape(0.0, 0.0, 0.0, 1e-9)))
    closed, integrated = exact_fit(taken), exact_fit(known)
    assert integrated.values["x_c_m"] == pytest.approx(x_c, abs=1e-6 * BEAM.length)
    assert integrated.values["force_n"] == pytest.approx(force, rel=1e-5)
    for name in closed.values:
        assert integrated.sigma(name) == pytest.approx(closed.sigma(name), rel=1e-3, abs=1e-15)
        assert integrated.values[name] == pytest.approx(
            closed.values[name], abs=0.1 * closed.sigma(name) + 1e-9
        )


def test_unknown_friction_widens_the_sigmas_as_much_as_it_moves_the_estimate(
    random: np.random.Generator,
) -> None:
    friction_ratio = 0.3
    stated = stated_shape(0.0, 0.0, 0.0, friction=friction_ratio)
    for sign in (-1, 1):
        beam = bent(0.0, 0.6, 1.2, friction=sign * friction_ratio)
        smooth = measured(beam, BeamShape(), random)
        certain = uniform_estimate(smooth).estimate
        honest = exact_fit(measured(beam, stated, random))
        truth = {"x_c_m": float(beam.points[0, 0])}
        assert abs(pulls(certain, truth)[0]) > 3
        assert exact_fit(smooth).outcome is Outcome.INVALID
        assert abs(pulls(honest, truth)[0]) < MOST_SIGMAS


def test_outliers_are_rejected_also_from_a_tapered_beam(random: np.random.Generator) -> None:
    beam = bent(-0.3, 0.6, 1.2)
    taken = measured(beam, MAYBE_TAPERED, random)
    points = np.array(taken.points)
    points[100:140, 1] += 30 * SIGMA
    spoilt = replace(taken, view=View(points, taken.sigma_vectors, taken.view.viewpoint))
    estimate = exact_fit(spoilt)
    assert estimate.outcome is Outcome.CONTACT
    assert abs(pulls(estimate, {"x_c_m": float(beam.points[0, 0])})[0]) < MOST_SIGMAS
    assert "40 of" in estimate.message


def test_a_section_out_of_round_leaves_the_place_and_widens_the_force(
    random: np.random.Generator,
) -> None:
    beam = bent(0.0, 0.6, 1.2)
    round_one = exact_fit(measured(beam, BeamShape(), random))
    oval = exact_fit(measured(beam, stated_shape(0.0, 0.0, 0.05, 0.0), random))
    truth = {"x_c_m": float(beam.points[0, 0])}
    assert abs(pulls(oval, truth)[0]) < MOST_SIGMAS
    assert oval.sigma("x_c_m") < 3 * round_one.sigma("x_c_m")
    relative = oval.sigma("force_n") / oval.values["force_n"]
    assert relative == pytest.approx(0.05 * np.sqrt(1.5), rel=0.1)


def test_too_few_points_and_no_bend_are_outcomes(random: np.random.Generator) -> None:
    beam = bent(0.0, 0.6, 1.2)
    taken = measured(beam, MAYBE_TAPERED, random)
    few = View(taken.points[:5], taken.sigma_vectors[:5], taken.view.viewpoint)
    assert exact_fit(replace(taken, view=few)).outcome is Outcome.NOT_IDENTIFIABLE
    straight = np.column_stack([taken.points[:, 0], np.zeros(len(taken.points))])
    flat = View(straight, taken.sigma_vectors, taken.view.viewpoint)
    assert exact_fit(replace(taken, view=flat)).outcome is Outcome.NO_CONTACT
