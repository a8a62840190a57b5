"""Contacts as functions of the push, and the limits with all its images."""

import numpy as np
import pytest

from tests.vbaa_bench.limits.experiments import paper_push, push
from vbaa_bench.limits.push_limits import PushLimits
from vbaa_bench.limits.push_model import push_gradients
from vbaa_bench.render.variant import activate


@pytest.fixture(autouse=True)
def _active(variant: str) -> None:
    activate(variant, 1)


def test_the_contact_of_a_small_push_follows_linear_theory() -> None:
    """N = s beta / (c + s^3 / 3 EI) at the place s for a pushing angle beta and a compliance c."""
    small = {"contact_distance_mm": [140], "deflection_pct": [0.2], "stiffness_n_m": [50.0]}
    (frame,) = push(pushes=small)
    state, rod = frame.pose.state, frame.pose.experiment.rod
    s, rigidity, angle = 0.14, rod.beam.flexural_rigidity, state.pushing_angle
    soft = 1 / 50.0 + s**3 / (3 * rigidity)
    force = s * angle / soft
    assert state.contact.force[1] == pytest.approx(force, rel=1e-3)
    expected = {
        "compliance": [0.0, -force / soft],
        "onset": [0.0, s / soft],
        "rigidity": [0.0, force / soft * s**3 / (3 * rigidity**2)],
        "contact_distance": [1.0, force / s - force / soft * s**2 / rigidity],
    }
    found = push_gradients(frame.pose.experiment, [state])
    for name, values in expected.items():
        column = found.gradients[0, :2, found.names.index(name)]
        np.testing.assert_allclose(column[1], values[1], rtol=5e-3)
        if name == "contact_distance":
            assert column[0] == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(found.of_angle[0], found.gradients[0, :, found.names.index("onset")])


def test_derivatives_of_a_push_do_not_depend_on_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    from vbaa_bench.limits import push_model

    frames = push(object={"kind": "peg", "friction": 0.2})
    states = [frame.pose.state for frame in frames]
    usual = push_gradients(frames[0].pose.experiment, states)
    assert "friction" in usual.names
    monkeypatch.setattr(push_model, "_STEP", push_model._STEP / 2)
    halved = push_gradients(frames[0].pose.experiment, states)
    scale = np.abs(usual.gradients).max(axis=(0, 1))
    np.testing.assert_allclose(
        halved.gradients / scale, usual.gradients / scale, rtol=1e-3, atol=1e-5
    )


def test_one_image_of_a_push_informs_as_one_image() -> None:
    """Three unknowns of the push take the place of three of the contact: the same information."""
    first = paper_push()[0]
    alone = dict(first.by_set())["image"]
    in_push = next(PushLimits([first]).limits())
    np.testing.assert_allclose(in_push[:4], alone[:4], rtol=1e-3)
    # Onset and stiffness cannot be separated.
    assert np.isinf(in_push[-1])


def test_a_second_image_reduces_all_limits_and_shows_the_stiffness() -> None:
    frames = paper_push()
    alone = dict(frames[1].by_set())["image"]
    together = list(PushLimits(frames).limits())[1]
    assert (together[:4] < alone[:4] * (1 + 1e-9)).all()
    assert together[0] < 0.99 * alone[0]
    assert np.isfinite(together[-1])


@pytest.mark.thorough
def test_a_second_contact_has_limits_that_decrease_with_its_load() -> None:
    single = dict(paper_push()[0].by_set())["planar"]
    assert np.isnan(single[-2:]).all()
    pushes = {"contact_distance_mm": [110], "pushing_angle_deg": [4, 8]}
    second = {"distance_mm": 190, "gap_mm": 1.5}
    frames = push(object={"kind": "peg"}, second_peg=second, pushes=pushes)
    loads = [np.linalg.norm(frame.imaged.beam.forces[1]) for frame in frames]
    limits = [dict(frame.by_set())["planar"] for frame in frames]
    assert loads[1] > 1.5 * loads[0]
    assert np.isfinite(limits[0][-2:]).all()
    # The place of a force is known in inverse proportion to its size, in linear theory.
    product = [limit[-2] * load for limit, load in zip(limits, loads, strict=True)]
    assert product[1] == pytest.approx(product[0], rel=0.5)
    assert limits[1][-2] < limits[0][-2]
