"""A beam that begins to bend elsewhere than at the rig's clamp, by the world's rod."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.instrument.beam_shape import CLAMP_SHIFT, SOFTNESS, BeamShape, stated_shape
from solver.instrument.measurement import Measurement, Tip, View
from solver.learning.learn import LearnedBeam, learn_beam
from solver.learning.page import summary
from solver.methods.exact_fit import exact_fit
from solver.methods.exact_fit_3d import exact_fit_3d
from solver.methods.push_fit import push_fit
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.simulated import BEAM, rig
from tests.solver.learning.test_clamp_offset import pushes as turned_pushes
from tests.tapered import bent, measured

PLACES = (0.35, 0.5, 0.62, 0.75, 0.88)
STRENGTHS = (0.1, 0.2, 0.3)
SHIFT = 0.8e-3
UNCERTAIN = stated_shape(0.0, 0.0, 0.0, 0.0, clamp_shift=1e-3 / BEAM.length)


def along(measurement: Measurement, shift: float) -> Measurement:
    """The same beam in a clamp that is `shift` [m] farther towards the tip."""
    view = measurement.view
    moved = View(view.points + np.array([shift, 0.0]), view.sigma_vectors, view.viewpoint, view.tip)
    return replace(measurement, view=moved)


def pushes(shift: float, shape: BeamShape, seed: int = 11) -> list[list[Measurement]]:
    random = generator(__name__, seed)
    return [
        [
            along(measured(bent(0.0, place, 3 * strength / place**2), shape, random), shift)
            for strength in STRENGTHS
        ]
        for place in PLACES
    ]


@cache
def learned(shift: float = SHIFT) -> LearnedBeam:
    return learn_beam(pushes(shift, UNCERTAIN))


@pytest.mark.thorough
@pytest.mark.parametrize("shift", [SHIFT, -SHIFT])
def test_the_place_is_learned(shift: float) -> None:
    shape = learned(shift).shape
    place, sigma = shape.clamp_shift * BEAM.length, shape.sigma(CLAMP_SHIFT) * BEAM.length
    assert sigma < 1e-5
    assert abs(place - shift) < MOST_SIGMAS * sigma
    assert f"begins to bend {place * 1e3:.3f}" in summary(learned(shift), rig(), rig())


@pytest.mark.thorough
def test_contacts_are_measured_from_there_and_stay_where_they_are(
    random: np.random.Generator,
) -> None:
    beam = bent(0.0, 0.7, 0.6)
    frame = along(measured(beam, UNCERTAIN, random), SHIFT)
    before = exact_fit(frame)
    after = exact_fit(replace(frame, rig=learned().rig(frame.rig)))
    true = float(beam.points[0, 0])
    for estimate in (before, after):
        assert abs(estimate.values["x_c_m"] - true) < MOST_SIGMAS * estimate.sigma("x_c_m")
        in_antenna = estimate.values["contact_antenna_x_m"]
        assert abs(in_antenna - true - SHIFT) < MOST_SIGMAS * estimate.sigma("contact_antenna_x_m")
    assert after.sigma("x_c_m") < 0.7 * before.sigma("x_c_m")
    certain = exact_fit(replace(frame, rig=replace(frame.rig, shape=BeamShape())))
    assert not certain.values or abs(certain.values["x_c_m"] - true) > 0.5 * SHIFT


@pytest.mark.thorough
def test_a_wire_gripped_deeper_is_distinguished_from_a_clamp_that_gives() -> None:
    """Nothing is stated: no clamp turns against its moment."""
    deeper = learn_beam(pushes(SHIFT, BeamShape()))
    assert (deeper.chosen.soft, deeper.chosen.shifted) == (False, True)
    assert deeper.shape.clamp_shift * BEAM.length == pytest.approx(SHIFT, rel=0.1)
    # The other way round both look the same, and the page says so.
    shallower = learn_beam(pushes(-SHIFT, BeamShape()))
    assert (shallower.chosen.soft, shallower.chosen.shifted) == (True, False)
    assert "begins to bend 0.8" in summary(shallower, rig(), rig())


@pytest.mark.thorough
def test_what_pushes_do_not_distinguish_keeps_its_prior() -> None:
    both = stated_shape(0.0, 0.002, 0.0, 0.0, clamp_shift=1e-3 / BEAM.length)
    shape = learn_beam(pushes(SHIFT, both)).shape
    # What would remain of either if only their difference were known.
    prior = 1 / np.hypot(1 / 0.002, BEAM.length / 1e-3)
    for parameter in (CLAMP_SHIFT, SOFTNESS):
        # The pushes' misfit widens it by some hundredths.
        assert 0.2 * prior < shape.sigma(parameter) < 1.1 * prior
    pair = shape.covariance[:2, :2]
    assert np.sqrt(np.array([1, -1]) @ pair @ [1, -1]) < 0.1 * prior
    # By linear theory the clamp that gives turns the beam as its first millimetres would.
    assert shape.clamp_shift - shape.softness == pytest.approx(SHIFT / BEAM.length, rel=0.1)
    place, sigma = shape.clamp_shift * BEAM.length, shape.sigma(CLAMP_SHIFT) * BEAM.length
    assert abs(place - SHIFT) < MOST_SIGMAS * sigma


@pytest.mark.thorough
def test_the_tip_stays_where_it_is(random: np.random.Generator) -> None:
    """A beam gripped deeper is as much shorter: the image of the tip keeps its plane at zero."""
    beam = bent(0.0, 0.7, 1.2)
    frame = along(measured(beam, UNCERTAIN, random), SHIFT)
    points, view = beam.centreline, frame.view
    end = np.array(
        [
            np.interp(BEAM.length - SHIFT, points[:, 0], points[:, 1]) + SHIFT,
            np.interp(BEAM.length - SHIFT, points[:, 0], points[:, 2]),
        ]
    )
    viewpoint = np.array([0.12, -0.1, 0.36, 1.0])
    seen = replace(view, tip=Tip(end, np.diag([5e-6, 5e-6]) ** 2), viewpoint=viewpoint)
    estimate = exact_fit_3d(replace(frame, view=seen, rig=learned().rig(frame.rig)))
    for name, true in (("psi_rad", 0.0), ("x_c_m", float(beam.points[0, 0]))):
        assert abs(estimate.values[name] - true) < MOST_SIGMAS * estimate.sigma(name), name
    assert estimate.sigma("psi_rad") < 0.2


def test_the_motor_turns_a_deeper_gripped_beam_about_the_same_axis() -> None:
    """The world's clamp is beside its axis by the shift; the rig states only the shift."""
    shape = BeamShape(clamp_shift=0.012 / BEAM.length, covariance=np.diag([0, 1e-12, 0]))
    frames = [along(frame, 0.012) for frame in turned_pushes(offset=(0.012, 0.0))[1]]
    known = [replace(frame, rig=replace(frame.rig, shape=shape)) for frame in frames]
    estimate = push_fit(replace(known[-1], earlier=tuple(known[:-1])))
    sigma = estimate.sigma("compliance_m_per_n")
    assert abs(estimate.values["compliance_m_per_n"]) < MOST_SIGMAS * sigma
