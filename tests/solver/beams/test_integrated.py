import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from solver.beams.beam import FRICTION_RATIO, Q
from solver.beams.curve import P, U, interpolated
from solver.beams.integrated import STEPS, contact_of, curve_of
from solver.beams.stretch import WIDTHS, width_at
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from tests import frictional

RADIUS = 1 / 600
TAPERED = np.array([3.0, 0.6, -0.3, -0.4])
PROFILED = np.array([1.0, 0.8, 0.1, -0.3, 0.1, 0.05])
BOW = np.array([0.02, -0.03, 0.01])


@settings(max_examples=50, deadline=None)
@given(st.floats(0.1, 0.98), st.floats(1e-4, 0.7), st.floats(-0.6, 0.6))
def test_a_uniform_beam_is_the_closed_form(
    lever: float, turn: float, friction_ratio: float
) -> None:
    q = 2 * turn / lever**2
    assume(frictional.exists(q, lever, friction_ratio))
    at = frictional.contact(q, lever, friction_ratio)
    assume(0.05 < at.s_c < 1.0 and at.theta_c < 1.2)
    p = np.array([q, float(at.s_c), friction_ratio])
    curve = curve_of(p, 0, 0.0, STEPS)
    assert curve.exists
    values, gradients = contact_of(curve, p)
    closed = np.array([at.load, at.theta_c, at.x_c, at.y_c, at.s_c, at.lean])
    # The error of the integration; a thousandth of a pixel is 2e-6 of the length.
    assert values == pytest.approx(closed, abs=2e-6)
    assert curve.base[0] == pytest.approx(lever, abs=2e-6)
    # The closed form's variables are (q, lever, friction ratio).
    d_x = at.d_x_c - at.d_x_c[1] * at.d_s_c / at.d_s_c[1]
    assert gradients[2, [Q, FRICTION_RATIO]] == pytest.approx(d_x[[0, 2]], abs=2e-5)
    assert gradients[2, 1] == pytest.approx(at.d_x_c[1] / at.d_s_c[1], abs=2e-5)


def test_a_little_bent_cone_is_that_of_linear_theory() -> None:
    """y = (F Lc^3 / EI) [1/(2u) - ua/(6u^2) + (1/2 - ua/3) u - 1 + ua/2], u = 1 - x / Lc."""
    taper, place, load = -0.4, 0.7, 1e-5
    p = np.array([load, place, 0.0, taper])
    values, _ = contact_of(curve_of(p, 1, 0.0, STEPS), p)
    cone = -1 / taper
    ua = u = 1 - place / cone
    shape = 1 / (2 * u) - ua / (6 * u**2) + (1 / 2 - ua / 3) * u - 1 + ua / 2
    assert values[3] == pytest.approx(load * cone**3 * shape, rel=1e-5)


@pytest.mark.parametrize(("p", "widths"), [(TAPERED, 1), (PROFILED, 3)])
def test_the_error_falls_with_the_fourth_power_of_the_step(p: Floats, widths: int) -> None:
    bowed = np.append(p, BOW)

    def contact(steps: int) -> Floats:
        values, _ = contact_of(curve_of(bowed, widths, RADIUS, steps), bowed)
        return values

    fine = contact(1024)
    errors = [float(np.abs(contact(steps) - fine).max()) for steps in (STEPS, 2 * STEPS)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.2)
    assert errors[0] < 3e-7


@njit
def _ordinates(nodes: Floats, places: Floats) -> Floats:
    values = np.empty(len(places))
    for i in range(len(places)):
        node = min(max(np.searchsorted(nodes[0], places[i]) - 1, 0), nodes.shape[1] - 2)
        values[i], _, _ = interpolated(nodes, node, places[i])
    return values


@pytest.mark.parametrize(
    ("p", "widths"),
    [(TAPERED, 1), (PROFILED, 3), (np.append(TAPERED, BOW), 1), (np.append(PROFILED, BOW), 3)],
)
def test_gradients_are_differences(p: Floats, widths: int) -> None:
    curve = curve_of(p, widths, RADIUS, STEPS)
    _, by_contact = contact_of(curve, p)
    places = curve.nodes[U, 1:-1]
    for i in range(len(p)):
        step = np.zeros(len(p))
        step[i] = 1e-6
        low, high = (curve_of(p + sign * step, widths, RADIUS, STEPS) for sign in (-1, 1))
        contacts = [contact_of(c, p + sign * step)[0] for c, sign in ((low, -1), (high, 1))]
        assert by_contact[:, i] == pytest.approx((contacts[1] - contacts[0]) / 2e-6, abs=1e-8)
        assert curve.by_base[i] == pytest.approx((high.base - low.base) / 2e-6, abs=1e-8)
        # At a node, the gradient at constant u is the node's own.
        difference = (_ordinates(high.nodes, places) - _ordinates(low.nodes, places)) / 2e-6
        assert curve.gradients[i, 0, 1:-1] == pytest.approx(difference, abs=3e-4)


def test_beyond_the_contact_the_beam_is_straight_or_has_its_bow() -> None:
    curve = curve_of(TAPERED, 1, RADIUS, STEPS)
    free = curve.nodes[:, : curve.contact + 1]
    assert np.ptp((free[P, 1:] - free[P, 0]) / (free[U, 1:] - free[U, 0])) < 1e-12
    unloaded = np.append([1e-9, 0.5, 0.0], BOW)
    bowed = curve_of(unloaded, 0, RADIUS, STEPS)
    angle, height = bowed.base[2], bowed.base[1]
    along, across = bowed.base[0] - bowed.nodes[U], bowed.nodes[P] - height
    x = along * np.cos(angle) - across * np.sin(angle)
    y = along * np.sin(angle) + across * np.cos(angle)
    line = BOW[0] * x**2 + BOW[1] * x**3 + BOW[2] * x**4
    assert y == pytest.approx(line, abs=1e-5)  # small slopes


def test_width_terms_are_legendre_polynomials() -> None:
    terms = np.empty(4)
    width, slope = width_at(0.3, np.array([0.1, 0.2, -0.3, 0.4]), terms)
    t = 2 * 0.3 - 1
    assert terms == pytest.approx(
        [0.3, 0.3 * t, 0.3 * (3 * t**2 - 1) / 2, 0.3 * (5 * t**3 - 3 * t) / 2]
    )
    above, _ = width_at(0.3 + 1e-6, np.array([0.1, 0.2, -0.3, 0.4]), terms)
    below, _ = width_at(0.3 - 1e-6, np.array([0.1, 0.2, -0.3, 0.4]), terms)
    assert slope == pytest.approx((above - below) / 2e-6, rel=1e-8)
    assert width == pytest.approx((above + below) / 2, rel=1e-9)


@pytest.mark.parametrize(
    "p",
    [
        [-1.0, 0.5, 0.0, 0.0],  # pulled
        [1.0, 1.2, 0.0, 0.0],  # beyond the tip
        [1.0, 0.5, 0.0, -0.99],  # a tip without width
        [40.0, 0.9, 0.0, 0.0],  # rolled up
    ],
)
def test_shapes_that_no_beam_has(p: list[float]) -> None:
    assert not curve_of(np.array(p), WIDTHS - 2, RADIUS, STEPS).exists


def test_beyond_the_contact_a_beam_without_bow_is_straight_also_with_friction() -> None:
    p = np.array([3.0, 0.6, 0.4, -0.3])
    curve = curve_of(p, 1, RADIUS, STEPS)
    tip, contact = curve.nodes[:, 0], curve.nodes[:, curve.contact]
    for part in (0.2, 0.5, 0.8):
        u = (1 - part) * tip[U] + part * contact[U]
        value, slope, _ = interpolated(curve.nodes, 0, u)
        assert value == pytest.approx((1 - part) * tip[P] + part * contact[P], abs=1e-14)
        assert slope == pytest.approx((contact[P] - tip[P]) / (contact[U] - tip[U]), abs=1e-13)
