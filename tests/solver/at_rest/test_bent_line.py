"""The line of the bent beam against closed forms and against NumPy."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from solver.at_rest.bent_line import MIN_POINTS, bent_line
from solver.at_rest.rest_line import RestLine
from solver.instrument.arrays import Floats
from tests.draws import generator
from tests.simulated import rig

LENGTH = 0.24
RANDOM = generator(__name__, 2)
MODES = 1e-5 * RANDOM.standard_normal((5, 5)) * np.array([1, 10, 1, 1, 1])[:, None]
REST = RestLine(1e-4, 0.01, np.array([1e-5, 2e-5, -1e-5]), MODES @ MODES.T, LENGTH)


def bent(x: Floats) -> Floats:
    """Points (n, 2) of a curve that leaves the clamp as the beam at rest does, at x over L."""
    x_c = rig().base_position[0] + LENGTH * x
    y = (
        REST.y_at_clamp
        + REST.slope * LENGTH * x
        + LENGTH * (0.2 * x**2 - 0.05 * x**3 + 0.01 * x**5)
    )
    return np.column_stack([x_c, y])


@pytest.mark.parametrize(("first", "last"), [(0.02, 1.0), (0.3, 0.8)])
def test_normals_and_turn_are_those_of_the_curve(first: float, last: float) -> None:
    x = np.linspace(first, last, 200)
    line = bent_line(bent(x), REST, rig())
    assert line is not None
    slope = REST.slope + 0.4 * x - 0.15 * x**2 + 0.05 * x**4
    assert_allclose(line.turn, np.arctan(slope) - np.arctan(REST.slope), atol=1e-9)
    expected = np.column_stack([-slope, np.ones_like(x)]) / np.hypot(1, slope)[:, None]
    assert_allclose(line.normals, expected, atol=1e-9)


def test_the_bow_is_that_at_the_same_arc_length() -> None:
    x = np.linspace(0.1, 0.85, 150)
    line = bent_line(bent(x), REST, rig())
    assert line is not None
    fine = np.linspace(0, 1, 20001)
    slope = REST.slope + 0.4 * fine - 0.15 * fine**2 + 0.05 * fine**4
    speed = np.hypot(1, slope)
    arcs = np.append(0, np.cumsum((speed[1:] + speed[:-1]) / 2)) * fine[1]
    bow, errors = REST.bow_errors_at(LENGTH * np.interp(x, fine, arcs))
    assert_allclose(line.bow, bow, rtol=1e-4)
    assert_allclose(line.bow_errors, errors, atol=1e-4 * np.abs(errors).max())


def test_a_straight_beam_turns_nowhere() -> None:
    x = np.linspace(0, 1, 50)
    straight = np.column_stack([rig().base_position[0] + LENGTH * x, 1e-4 + 0.01 * LENGTH * x])
    line = bent_line(straight, REST, rig())
    assert line is not None
    assert_allclose(line.turn, 0, atol=1e-12)


def test_a_short_stretch_is_fitted_by_a_cubic_and_few_points_by_nothing() -> None:
    """NumPy's singular value decomposition gives the same curve."""
    x = np.linspace(0.7, 0.95, 60)
    points = bent(x) + 1e-5 * RANDOM.standard_normal((60, 2)) * [0, 1]
    line = bent_line(points, replace(REST, slope=0.0), rig())
    assert line is not None
    y = (points[:, 1] - REST.y_at_clamp) / LENGTH
    weights, *_ = np.linalg.lstsq(np.column_stack([x**2, x**3]), y)
    assert_allclose(np.tan(line.turn), 2 * weights[0] * x + 3 * weights[1] * x**2, rtol=1e-9)
    assert bent_line(points[: MIN_POINTS - 1], REST, rig()) is None
