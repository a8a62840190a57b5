"""The beam with two contacts: derivatives, order of convergence, limits."""

import numpy as np
import pytest

from solver.beam_models.curve import SLOPE, P, U, interpolated
from solver.beam_models.exact import contact_at
from solver.beam_models.two_contacts import (
    PARAMETERS,
    Q_INNER,
    Q_OUTER,
    S_INNER,
    S_OUTER,
    contacts_of,
    two_contacts_of,
)
from solver.instrument.arrays import Floats

# A second peg that holds the beam back, one that helps, and forces whose sum vanishes.
SHAPES = [(-1.5, 0.8, 5.0, 0.45), (1.2, 0.9, 2.0, 0.3), (-4.0, 0.7, 4.0, 0.4)]


def shape(q_outer: float, s_outer: float, q_inner: float, s_inner: float) -> Floats:
    p = np.empty(PARAMETERS)
    p[Q_OUTER], p[S_OUTER], p[Q_INNER], p[S_INNER] = q_outer, s_outer, q_inner, s_inner
    return p


def heights(p: Floats, u: Floats) -> Floats:
    """P at the places u (n,), by the nodes' interpolation."""
    nodes = two_contacts_of(p).curve.nodes
    columns = np.clip(np.searchsorted(nodes[U], u) - 1, 0, nodes.shape[1] - 2)
    return np.array([interpolated(nodes, i, v)[0] for i, v in zip(columns, u, strict=True)])


@pytest.mark.parametrize("entries", SHAPES)
def test_gradients_are_those_of_differences(entries: tuple[float, ...]) -> None:
    p, h = shape(*entries), 1e-5
    both = two_contacts_of(p)
    assert both.curve.exists
    _, gradients = contacts_of(both, p)
    nodes = both.curve.nodes
    # Between the nodes, where the interpolation of neighbouring shapes is smooth.
    middle = np.arange(2, nodes.shape[1] - 2, 5)
    u = (nodes[U, middle] + nodes[U, middle + 1]) / 2
    for i in range(PARAMETERS):
        moved = [p + sign * h * np.eye(PARAMETERS)[i] for sign in (1, -1)]
        ahead, behind = (contacts_of(two_contacts_of(one), one)[0] for one in moved)
        assert (ahead - behind) / (2 * h) == pytest.approx(gradients[:, :, i], abs=1e-8)
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


@pytest.mark.parametrize("entries", SHAPES)
def test_errors_are_of_fourth_order(entries: tuple[float, ...]) -> None:
    p = shape(*entries)
    exact, _ = contacts_of(two_contacts_of(p, 256), p)
    errors = [
        float(np.abs(contacts_of(two_contacts_of(p, steps), p)[0] - exact).max())
        for steps in (8, 16, 32)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4.0, 4.0], abs=0.2)
    assert errors[1] < 3e-8


def test_one_force_alone_is_the_exact_beam() -> None:
    q, s = 3.0, 0.5
    for p, row in ((shape(0.0, 0.9, q, s), 0), (shape(q, s, 0.0, 0.2), 1)):
        contacts, _ = contacts_of(two_contacts_of(p, 64), p)
        force, theta, x, y, arc = contacts[row]
        lever = float(two_contacts_of(shape(q, s, 0.0, 0.2), 64).curve.base[U])
        closed = np.array(contact_at(q, lever))[:, 0]
        assert (force, arc) == (q, s)
        assert (theta, x, y, arc) == pytest.approx(closed, rel=1e-9)


def test_two_contacts_at_one_place_are_one_with_both_forces() -> None:
    near, one = shape(1.0, 0.5 + 1e-7, 2.0, 0.5), shape(3.0, 0.5, 0.0, 0.2)
    assert contacts_of(two_contacts_of(near), near)[0][1, 1:4] == pytest.approx(
        contacts_of(two_contacts_of(one), one)[0][1, 1:4], abs=1e-6
    )


def test_beyond_the_outer_contact_the_beam_is_straight() -> None:
    nodes = two_contacts_of(shape(*SHAPES[0])).curve.nodes
    assert nodes[[P, SLOPE], :2] == pytest.approx(np.zeros((2, 2)))
    assert nodes[U, 0] == pytest.approx(0.8 - 1.05)


@pytest.mark.parametrize(
    "entries", [(1.0, 0.4, 1.0, 0.5), (1.0, 0.5, 1.0, 0.0), (1.0, 1.2, 1.0, 0.5), (9, 0.9, 9, 0.5)]
)
def test_impossible_shapes_do_not_exist(entries: tuple[float, ...]) -> None:
    assert not two_contacts_of(shape(*entries)).curve.exists
