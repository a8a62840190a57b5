"""The compiled residuals and constraints, against `frictional.misfit` and against differences."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.uniform.constraints import add_constraints
from solver.uniform.residuals import PARAMETERS, PSI, FrameArrays, is_feasible, point_residuals
from tests import frictional

PINHOLE = np.array([0.5, 0.1, 0.7])
FAR_AWAY = np.array([0.3, -0.2, 0.0])
# Gentle and steep, in plane C and out of it, turned much and little.
SHAPES = [
    np.array([0.8, 0.6, 0.0, 0.001, 0.002, 0.003, 0.0, 0.0]),
    np.array([0.8, 0.6, 0.5, 0.001, 0.002, 0.3, 0.01, 0.02]),
    np.array([2.8, 0.6, -0.5, 0.001, 0.002, -0.3, -0.01, 0.0]),
]


def points(sigma_x: float, sigma_y: float) -> Floats:
    x = np.linspace(0.01, 1, 40)
    ones = np.ones_like(x)
    return np.vstack([x, 0.2 * x**2, sigma_x * ones, sigma_y * ones])


def residuals(
    p: Floats, rows: Floats, view: Floats, spatial: bool = False
) -> tuple[Floats, Floats]:
    residual, jacobian = np.empty(rows.shape[1]), np.empty((6, rows.shape[1]))
    assert is_feasible(p, rows, view)
    point_residuals(p, rows, view, spatial, residual, jacobian)
    return residual, jacobian


def test_in_plane_c_it_is_the_misfit_of_the_exact_beam() -> None:
    rows = points(0.0, 1e-4)
    p = np.zeros(PARAMETERS)
    for q, lever in ((0.8, 0.6), (4.0, 0.65)):
        p[:2] = q, lever
        value, by_point, by_shape = frictional.misfit(rows[0], rows[1], q, lever)
        residual, jacobian = residuals(p, rows, PINHOLE)
        sigma = 1e-4 * by_point[:, 1]
        assert residual == pytest.approx(value / sigma, rel=1e-9, abs=1e-9)
        by_both = jacobian[:2].T
        assert by_both == pytest.approx(by_shape[:, :2] / sigma[:, None], rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("p", SHAPES, ids=["plane", "gentle", "steep"])
@pytest.mark.parametrize("view", [PINHOLE, FAR_AWAY], ids=["pinhole", "telecentric"])
def test_its_jacobian_is_that_of_differences(p: Floats, view: Floats) -> None:
    rows = points(0.0, 0.0)  # the least sigma throughout, so that weights do not depend on p
    _, jacobian = residuals(p, rows, view)
    for a in range(6):
        step = np.zeros(PARAMETERS)
        step[a] = 1e-6
        ahead, behind = (
            residuals(p + step, rows, view),
            residuals(p - step, rows, view),
        )
        slope = (ahead[0] - behind[0]) / 2e-6
        assert np.abs(slope - jacobian[a]).max() < 1e-6 * np.abs(slope).max()


@pytest.mark.parametrize("p", SHAPES, ids=["plane", "gentle", "steep"])
def test_a_residual_is_by_how_many_of_its_sigmas_a_point_is_off(p: Floats) -> None:
    rows = points(3e-7, 1e-6)
    for _ in range(4):  # onto the beam's image
        residual, _ = residuals(p, rows, PINHOLE)
        rows[:2] -= residual * rows[2:]
    moved = rows.copy()
    moved[:2] += 2.5 * rows[2:]
    later, _ = residuals(p, moved, PINHOLE)
    assert later == pytest.approx(2.5, rel=1e-4)
    # Where psi is sought the Jacobian does not know the point's error.
    _, here = residuals(p, rows, PINHOLE, spatial=True)
    _, there = residuals(p, moved, PINHOLE, spatial=True)
    assert there[PSI] == pytest.approx(here[PSI], rel=1e-6)


@pytest.mark.parametrize("p", SHAPES, ids=["plane", "gentle", "steep"])
def test_the_constraints_gradient_is_that_of_their_chi2(p: Floats) -> None:
    known = np.array([0.02, 0.01, 0.3, 1e-3, 0.01])
    whitening = np.linalg.inv(np.linalg.cholesky(np.diag([1e-4, 2e-4, 3e-4]) + 5e-5))
    tips = np.array([[0.9, 0.3, 900.0, 0.0, 200.0, 1100.0, 0.05]])
    frame = FrameArrays(np.zeros((4, 0)), PINHOLE, tips, known, whitening)

    def chi2(p: Floats) -> tuple[float, Floats]:
        gradient = np.zeros(PARAMETERS)
        normal = np.zeros((PARAMETERS, PARAMETERS))
        value = add_constraints(p, frame, normal, gradient)
        return float(value), gradient

    _, gradient = chi2(p)
    for a in range(PARAMETERS):
        step = np.zeros(PARAMETERS)
        step[a] = 1e-6
        slope = (chi2(p + step)[0] - chi2(p - step)[0]) / 4e-6
        assert slope == pytest.approx(gradient[a], rel=1e-5, abs=1e-4 * np.abs(gradient).max())
