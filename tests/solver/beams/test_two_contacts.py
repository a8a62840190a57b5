"""The beam with two contacts: derivatives, order of convergence, limits."""

import numpy as np
import pytest

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.beams.curve import SLOPE, P, U, interpolated
from solver.beams.exact import contact_at
from solver.beams.integrated import contact_of, curve_of
from solver.beams.stretch import WIDTHS
from solver.beams.two_contacts import (
    FRICTION_RATIO_INNER,
    INNER_PARAMETERS,
    Q_INNER,
    S_INNER,
    TwoContacts,
    contacts_of,
    two_contacts_of,
)
from solver.instrument.arrays import Floats

RADIUS = 1 / 600
# A second peg that holds the beam back, one that helps, and forces whose sum vanishes.
SHAPES = [(-1.5, 0.8, 5.0, 0.45), (1.2, 0.9, 2.0, 0.3), (-4.0, 0.7, 4.0, 0.4)]
# A taper and a bow.
BEAM = (-0.3, 0.02, -0.03, 0.01)


def shape(
    q_outer: float,
    s_outer: float,
    q_inner: float,
    s_inner: float,
    friction_ratios: tuple[float, float] = (0.0, 0.0),
    beam: tuple[float, ...] = (),
) -> Floats:
    p = np.zeros(WIDTHS + len(beam) + INNER_PARAMETERS)
    p[Q], p[S_C], p[Q_INNER], p[S_INNER] = q_outer, s_outer, q_inner, s_inner
    p[FRICTION_RATIO], p[FRICTION_RATIO_INNER] = friction_ratios
    p[WIDTHS:Q_INNER] = beam
    return p


CASES = [shape(*entries) for entries in SHAPES] + [
    shape(*entries, (0.2, -0.3), BEAM) for entries in SHAPES
]


def bent(p: Floats, steps: int = 16) -> TwoContacts:
    return two_contacts_of(p, 1 if len(p) > WIDTHS + INNER_PARAMETERS else 0, RADIUS, steps)


def heights(p: Floats, u: Floats) -> Floats:
    """P at the places u (n,), by the nodes' interpolation."""
    nodes = bent(p).curve.nodes
    columns = np.clip(np.searchsorted(nodes[U], u) - 1, 0, nodes.shape[1] - 2)
    return np.array([interpolated(nodes, i, v)[0] for i, v in zip(columns, u, strict=True)])


@pytest.mark.parametrize("p", CASES)
def test_gradients_are_those_of_differences(p: Floats) -> None:
    h = 1e-5
    both = bent(p)
    assert both.curve.exists
    _, gradients = contacts_of(both, p)
    nodes = both.curve.nodes
    # Between the nodes, where the interpolation of neighbouring shapes is smooth.
    middle = np.arange(2, nodes.shape[1] - 2, 5)
    u = (nodes[U, middle] + nodes[U, middle + 1]) / 2
    for i in range(len(p)):
        moved = [p + sign * h * np.eye(len(p))[i] for sign in (1, -1)]
        shapes = [bent(one) for one in moved]
        ahead, behind = (contacts_of(*pair)[0] for pair in zip(shapes, moved, strict=True))
        assert (ahead - behind) / (2 * h) == pytest.approx(gradients[:, :, i], abs=1e-8)
        moment = (shapes[0].moment - shapes[1].moment) / (2 * h)
        assert moment == pytest.approx(both.by_moment[i], abs=1e-8)
        by_u = [
            float(
                np.dot(
                    interpolated(nodes, k, v)[2], both.curve.gradients[i, :, k : k + 2].T.ravel()
                )
            )
            for k, v in zip(middle, u, strict=True)
        ]
        differences = (heights(moved[0], u) - heights(moved[1], u)) / (2 * h)
        assert differences == pytest.approx(by_u, abs=1e-5)


@pytest.mark.parametrize("p", CASES)
def test_errors_are_of_fourth_order(p: Floats) -> None:
    exact, _ = contacts_of(bent(p, 256), p)
    errors = [
        float(np.abs(contacts_of(bent(p, steps), p)[0] - exact).max()) for steps in (8, 16, 32)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4.0, 4.0], abs=0.25)
    assert errors[1] < 2e-7


def test_one_force_alone_is_the_exact_beam() -> None:
    q, s = 3.0, 0.5
    for p, row in ((shape(0.0, 0.9, q, s), 0), (shape(q, s, 0.0, 0.2), 1)):
        contacts, _ = contacts_of(bent(p, 64), p)
        force, theta, x, y, arc, lean = contacts[row]
        lever = float(bent(shape(q, s, 0.0, 0.2), 64).curve.base[U])
        closed = np.array(contact_at(q, lever))[:, 0]
        assert (force, arc, lean) == (q, s, 0.0)
        assert (theta, x, y, arc) == pytest.approx(closed, rel=1e-9)


def test_one_force_alone_bends_the_rod_of_one_contact() -> None:
    q, s, friction_ratio = 3.0, 0.5, 0.3
    p = np.array([q, s, friction_ratio, *BEAM])
    curve = curve_of(p, 1, RADIUS, 64)
    expected, _ = contact_of(curve, p)
    root = np.hypot(1, friction_ratio)
    for both, row in (
        (shape(0.0, 0.9, q, s, (0.2, friction_ratio), BEAM), 0),
        (shape(q, s, 0.0, 0.2, (friction_ratio, 0.1), BEAM), 1),
    ):
        contacts, _ = contacts_of(bent(both, 64), both)
        assert contacts[row] == pytest.approx(expected, abs=1e-9)
        assert bent(both, 64).moment == pytest.approx(q * root * curve.base[U], rel=1e-9)


def test_two_contacts_at_one_place_are_one_with_both_forces() -> None:
    near, one = shape(1.0, 0.5 + 1e-7, 2.0, 0.5), shape(3.0, 0.5, 0.0, 0.2)
    assert contacts_of(bent(near), near)[0][1, 1:4] == pytest.approx(
        contacts_of(bent(one), one)[0][1, 1:4], abs=1e-6
    )


def test_beyond_the_outer_contact_the_beam_is_straight() -> None:
    nodes = bent(shape(*SHAPES[0])).curve.nodes
    assert nodes[[P, SLOPE], :2] == pytest.approx(np.zeros((2, 2)))
    assert nodes[U, 0] == pytest.approx(0.8 - 1.05)


@pytest.mark.parametrize(
    "entries", [(1.0, 0.4, 1.0, 0.5), (1.0, 0.5, 1.0, 0.0), (1.0, 1.2, 1.0, 0.5), (9, 0.9, 9, 0.5)]
)
def test_impossible_shapes_do_not_exist(entries: tuple[float, float, float, float]) -> None:
    assert not bent(shape(*entries)).curve.exists
