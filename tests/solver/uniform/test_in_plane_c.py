"""Normal equations in plane C, against the Jacobian that they do without."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.uniform.in_plane_c import plane_equations
from solver.uniform.minimise import invert
from solver.uniform.residuals import PARAMETERS, PSI, point_residuals
from tests.draws import generator

GENTLE = np.array([0.8, 0.6, 0.0, 0.001, 0.002, 0.003, 0.0, 0.0])
TURNED = np.array([0.8, 0.6, 0.0, -0.02, 0.01, 0.3, 0.01, 0.02])
STEEP = np.array([4.0, 0.65, 0.0, 0.001, 0.002, -0.2, 0.0, 0.0])


VIEW = np.array([0.5, 0.1, 0.7])


def points_of(n: int) -> Floats:
    """Points (4, n) about a beam, some behind the clamp."""
    random = generator(__name__, n)
    x = np.linspace(-0.3, 1, n)
    y = 0.2 * x**2 + 1e-3 * random.standard_normal(n)
    sigma_x, sigma_y = 1e-5 * random.standard_normal(n), 1e-4 * random.uniform(0.5, 2, n)
    return np.vstack([x, y, sigma_x, sigma_y])


@pytest.mark.parametrize("p", [GENTLE, TURNED, STEEP], ids=["gentle", "turned", "steep"])
@pytest.mark.parametrize("n", [2, 3, 9, 100])  # shorter and longer than a vector register
def test_they_are_the_products_of_the_general_jacobian(p: Floats, n: int) -> None:
    points = points_of(n)
    expected, jacobian = np.empty(n), np.empty((6, n))
    point_residuals(p, points, VIEW, False, expected, jacobian)
    residual, normal = np.empty(n), np.full((PARAMETERS, PARAMETERS), np.nan)
    gradient = np.full(PARAMETERS, np.nan)
    chi2 = plane_equations(p, points, residual, normal, gradient)
    assert residual == pytest.approx(expected, rel=1e-9)
    assert chi2 == pytest.approx(expected @ expected, rel=1e-9)
    rows = np.zeros((PARAMETERS, n))
    rows[:6] = jacobian
    rows[PSI] = 0.0
    size = np.linalg.norm(rows, axis=1)
    assert (np.abs(normal - rows @ rows.T) <= 1e-10 * np.outer(size, size)).all()
    assert (np.abs(gradient - rows @ expected) <= 1e-10 * size * np.sqrt(chi2)).all()


def test_the_points_of_one_plane_curve_tell_four_of_its_five_parameters() -> None:
    # Along itself, a curve may be moved by the clamp as well as by its lever and q.
    points = points_of(100)
    normal, gradient = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS)
    plane_equations(GENTLE, points, np.empty(100), normal, gradient)
    free = np.array([0, 1, 3, 4, 5])
    assert not invert(normal, free, np.empty((PARAMETERS, PARAMETERS)))
    assert invert(normal, free[:4], np.empty((PARAMETERS, PARAMETERS)))
