"""A beam whose curvature is stated, against the integrated one: two roads to the same shape."""

import numpy as np
import pytest

from solver.beams.beam import BentBeam
from solver.beams.integrated_beam import IntegratedBeam
from solver.beams.own_beam import OwnBeam
from solver.fitting.beam_residuals import beam_residuals
from solver.instrument.arrays import Floats

RADIUS = 0.01
# Load, place, friction ratio, two coefficients of the width, three of the bow.
SHAPES = {
    "gentle": np.array([1.2, 0.6, 0.1, -0.1, 0.02, 0.01, -0.02, 0.005]),
    "dragged back": np.array([1.5, 0.8, -0.2, 0.1, 0.0, 0.0, 0.01, 0.0]),
    "near the tip": np.array([0.5, 0.95, 0.0, -0.2, 0.05, 0.0, 0.0, 0.01]),
    "steep": np.array([4.0, 0.5, 0.3, -0.1, 0.02, 0.01, -0.02, 0.005]),
}


def both(p: Floats) -> tuple[BentBeam, BentBeam]:
    one, own = (beam.bent(p) for beam in (IntegratedBeam(2, 3, RADIUS), OwnBeam(2, 3, RADIUS)))
    assert one is not None
    assert own is not None
    return one, own


@pytest.mark.parametrize("p", SHAPES.values(), ids=SHAPES.keys())
def test_contact_and_moment_are_those_of_the_integrated_beam(p: Floats) -> None:
    one, own = both(p)
    assert own.contacts == pytest.approx(one.contacts, abs=1e-7)
    assert own.by_contacts == pytest.approx(one.by_contacts, abs=2e-6)
    assert own.moment == pytest.approx(one.moment, abs=1e-6)
    assert own.by_moment == pytest.approx(one.by_moment, abs=5e-6)


@pytest.mark.parametrize("p", SHAPES.values(), ids=SHAPES.keys())
def test_residuals_are_those_of_the_integrated_beam(p: Floats) -> None:
    one, _ = both(p)
    base = np.array([0.05, 1e-3, -1e-3, 0.02, 0.01])
    # Near the curve, as points of an image are.
    x = np.linspace(0.05, 0.95 * one.contacts[0, 2], 40)
    turn = base[3] + base[4] * one.moment
    u = one.curve.base[0] - x * np.cos(one.curve.base[2])
    order = np.argsort(one.curve.nodes[0])
    y = np.interp(u, one.curve.nodes[0][order], -one.curve.nodes[1][order]) + one.curve.base[1]
    points = np.vstack([x, x * turn + y, np.zeros(len(x)), np.full(len(x), 1e-2)])
    view, parameters, found = np.array([0.4, 0.0, 1.0]), np.append(p, base), []
    for beam in (IntegratedBeam(2, 3, RADIUS), OwnBeam(2, 3, RADIUS)):
        residual, jacobian = np.empty(len(x)), np.empty((len(parameters), len(x)))
        assert beam_residuals(beam, parameters, points, view, residual, jacobian)
        found.append((residual, jacobian))
    (residual, jacobian), (own_residual, own_jacobian) = found
    assert own_residual == pytest.approx(residual, abs=1e-3)
    assert own_jacobian == pytest.approx(jacobian, abs=5e-3 * float(np.abs(jacobian).max()))


def test_its_error_falls_with_the_fourth_power_of_its_steps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    p, errors = SHAPES["steep"], []
    exact, _ = both(p)
    for steps in (4, 8, 16):
        monkeypatch.setattr("solver.beams.own_beam._STEPS", steps)
        own = OwnBeam(2, 3, RADIUS).bent(p)
        assert own is not None
        errors.append(float(np.hypot(*(own.contacts - exact.contacts)[0, 2:4])))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 3).all(), orders


@pytest.mark.parametrize(
    "p", [[-0.1, 0.6, 0.0], [1.0, 1.2, 0.0], [1.0, 0.6, 20.0], [40.0, 0.9, 0.0]]
)
def test_a_shape_that_no_beam_has_is_none(p: list[float]) -> None:
    assert OwnBeam(0, 0, RADIUS).bent(np.array(p)) is None
