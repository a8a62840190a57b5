"""A section that is not round, learned from pushes of the world's rod in space."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.instrument.beam_shape import SKEW, stated_shape
from solver.instrument.measurement import Measurement
from solver.learning.known_force import rig_with_force
from solver.learning.learn import LearnedBeam, learn_beam
from solver.learning.page import summary
from solver.methods.exact_fit import exact_fit
from solver.methods.exact_fit_3d import exact_fit_3d
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM, measurement, rig
from tests.simulated_space import ABOVE_MIDDLE, PIXEL, view
from tests.solver.methods.pushes import mirrored
from tests.vbaa_bench.mechanics.benches import obstacle, push_one
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.state import State

ROD = Rod(BEAM, aspect_ratio=1.15, section_angle=math.radians(30))
PLACES = (0.08, 0.12, 0.16, 0.2)
DEFLECTIONS = (0.05, 0.1, 0.2)
STATED = stated_shape(taper=0.0, softness=0.0, section=0.15, friction=0.0)
SIGMA = 0.01 * PIXEL


@cache
def state(place: float, deflection: float) -> State:
    """The world's elliptic beam against an upright edge: its deflection leaves plane C."""
    touched = obstacle(BEAM, place)
    return push_one(ROD, touched, place, deflection=deflection, intervals=2000)


def force(place: float, deflection: float) -> float:
    return float(np.linalg.norm(state(place, deflection).contact.force))


def measured(place: float, deflection: float, random: np.random.Generator) -> Measurement:
    seen = view(state(place, deflection), ABOVE_MIDDLE, sigma=SIGMA, random=random)
    taken = measurement(seen.points, SIGMA, base_sigma=2e-6)
    return replace(taken, view=seen, rig=replace(taken.rig, shape=STATED))


def pushes(seed: int = 1) -> list[list[Measurement]]:
    random = generator(__name__, seed)
    return [[measured(place, by, random) for by in DEFLECTIONS] for place in PLACES]


@cache
def learned() -> LearnedBeam:
    return learn_beam(pushes())


def true_skew() -> float:
    """Angle from plane C, in which the force is, to the displacement of a small push."""
    _, y, z = state(PLACES[1], DEFLECTIONS[0]).contact.point
    return math.atan2(z, y)


@pytest.mark.thorough
def test_the_plane_of_deflection_is_learned_against_that_of_the_force() -> None:
    shape = learned().shape
    assert shape.sigma(SKEW) < 0.2 * STATED.sigma(SKEW)
    # It turns by up to 0.2 degrees in large pushes.
    error = math.hypot(shape.sigma(SKEW), math.radians(0.2))
    assert abs(shape.skew - true_skew()) < MOST_SIGMAS * error
    words = f"plane of the force to that of the deflection: {math.degrees(shape.skew):.2f} +- "
    assert words in summary(learned(), rig(), rig())


@pytest.mark.thorough
def test_one_known_force_gives_all_others(random: np.random.Generator) -> None:
    """The direction of the section has made forces depend on the deflection by a percent."""
    reference = measured(0.14, 0.2, random)
    known = learned().rig(reference.rig)
    true = force(0.14, 0.2)
    known = rig_with_force(known, reference, true, 1e-3 * true)
    errors, before = [], []
    for place in (0.1, 0.18):
        for by in (0.05, 0.1, 0.2):
            frame = measured(place, by, random)
            estimate = exact_fit(replace(frame, rig=known))
            error = estimate.values["force_n"] - force(place, by)
            assert abs(error) < MOST_SIGMAS * estimate.sigma("force_n")
            errors.append(error / force(place, by))
            stated = exact_fit(frame)
            before.append(stated.values["force_n"] / force(place, by) - 1)
            assert abs(before[-1]) * force(place, by) < 3 * stated.sigma("force_n")
    assert np.sqrt(np.mean(np.square(errors))) < 0.003
    assert "would determine it" not in summary(learned(), known, rig())
    assert np.sqrt(np.mean(np.square(before))) > 0.03


@pytest.mark.thorough
def test_the_force_that_is_advised_determines_ei_as_predicted(random: np.random.Generator) -> None:
    advice = learned().next_force
    assert advice is not None
    assert advice.before == pytest.approx(STATED.rigidity_sigma)
    assert "a known force of about" in summary(learned(), learned().rig(rig()), rig())
    place, by = advice.place * BEAM.length, advice.deflection
    # The world's force at this push, but for the skew and EI of the section.
    unit = BEAM.flexural_rigidity / BEAM.length**2
    assert force(place, by) == pytest.approx(advice.force * unit, rel=0.15)
    frame = measured(place, by, random)
    known = rig_with_force(learned().rig(frame.rig), frame, force(place, by), 0.0)
    reached = known.tolerances.flexural_rigidity / known.beam.flexural_rigidity
    assert 0.5 < reached / advice.after < 2  # as the learned beams differ


@pytest.mark.thorough
def test_the_mirrored_rig_has_the_opposite_skew() -> None:
    frames = [[mirrored(frame) for frame in push] for push in pushes()]
    assert learn_beam(frames).shape.skew == pytest.approx(-learned().shape.skew, rel=1e-3)


@pytest.mark.thorough
def test_a_section_that_the_rig_states_as_round_is_not_learned() -> None:
    plain = stated_shape(taper=0.0, softness=0.01, section=0.0, friction=0.0)
    frames = [
        [replace(frame, rig=replace(frame.rig, shape=plain)) for frame in push] for push in pushes()
    ]
    beam = learn_beam(frames)
    assert beam.shape.skew == beam.shape.sigma(SKEW) == 0
    assert "plane of the force" not in summary(beam, rig(), rig())


def test_an_unknown_plane_is_estimated_as_before(random: np.random.Generator) -> None:
    """The method in space estimates the plane of deflection, whatever was learned of its prior."""
    frame = measured(0.16, 0.2, random)
    # Four images determine the skew to a ninth of itself: enough for a prior that could be used.
    beam = learn_beam([push[1:] for push in pushes()[::2]])
    assert beam.shape.skew > 4 * beam.shape.sigma(SKEW)
    estimate = exact_fit_3d(replace(frame, rig=beam.rig(frame.rig)))
    assert abs(estimate.values["psi_rad"] - true_skew()) < MOST_SIGMAS * estimate.sigma("psi_rad")
