"""The loop of least squares: closed forms, curved and edged problems, and shared parameters."""

import numpy as np
import pytest

from solver.core.least_squares import (
    CONVERGED,
    BorderedEquations,
    NormalEquations,
    Rows,
    fit_rows,
    minimise,
    normal_equations,
    whole,
)
from solver.instrument.arrays import Floats


def test_a_linear_problem_is_solved_in_closed_form(random: np.random.Generator) -> None:
    # Columns of very different units, as a force and a length are.
    design = random.standard_normal((40, 3)) * [1e-6, 1.0, 1e6]
    truth = np.array([2e6, -1.0, 3e-6])
    data = design @ truth
    fit = fit_rows(lambda p: Rows(design @ p - data, np.ascontiguousarray(design.T)), np.zeros(3))
    assert fit.converged
    assert fit.iterations <= 2
    assert fit.parameters == pytest.approx(truth, rel=1e-9)
    assert fit.covariance == pytest.approx(np.linalg.inv(design.T @ design), rel=1e-6)


def test_a_curved_problem_converges_from_afar() -> None:
    t = np.linspace(0, 1, 20)

    def rows(p: Floats) -> Rows | None:
        if p[1] < 0:
            return None
        decay = np.exp(-p[1] * t)
        jacobian = np.array([decay, -p[0] * t * decay])
        return Rows((p[0] * decay - 3 * np.exp(-2 * t)) / 1e-3, jacobian / 1e-3)

    fit = fit_rows(rows, np.array([1.0, 0.1]))
    assert fit.converged
    assert fit.parameters == pytest.approx([3, 2], rel=1e-5)


def test_a_narrow_curved_valley_is_followed() -> None:
    # Rosenbrock's valley, a thousand times as narrow as it is long.
    def rows(p: Floats) -> Rows:
        jacobian = np.array([[-2000 * p[0], -1.0], [1000.0, 0.0]])
        return Rows(np.array([1000 * (p[1] - p[0] ** 2), 1 - p[0]]), jacobian)

    fit = fit_rows(rows, np.array([-1.2, 1.0]))
    assert fit.converged
    assert fit.parameters == pytest.approx([1, 1], abs=1e-3)


def test_an_open_direction_is_reported() -> None:
    def rows(p: Floats) -> Rows:
        return Rows(np.array([p[0] + p[1] - 1.0, 0.0]), np.array([[1.0, 0.0], [1.0, 0.0]]))

    fit = fit_rows(rows, np.zeros(2))
    assert fit.rank_deficient
    assert np.isfinite(fit.parameters).all()


def test_a_start_outside_the_domain_is_refused() -> None:
    with pytest.raises(ValueError, match="domain"):
        fit_rows(lambda _: None, np.zeros(2))


def test_a_prior_is_a_measurement_and_fixed_parameters_stay(random: np.random.Generator) -> None:
    design, data = random.standard_normal((3, 20)), random.standard_normal(20)
    root, mean = random.standard_normal((3, 3)), random.standard_normal(3)
    free = np.array([0, 2])

    def system(p: Floats) -> NormalEquations:
        block = whole(Rows(p @ design - data, design))
        return normal_equations(p, free, mean, root.T @ root, (block,))

    start = np.array([0.0, 0.7, 0.0])
    found = minimise(system, start)
    assert found is not None
    assert found.status == CONVERGED
    rows = np.vstack([design.T, root])
    right = np.append(data, root @ mean) - 0.7 * rows[:, 1]
    expected, (residual,), *_ = np.linalg.lstsq(rows[:, free], right)
    assert found.at.p[free] == pytest.approx(expected, rel=1e-9)
    assert found.at.p[1] == 0.7
    assert found.at.objective == pytest.approx(residual, rel=1e-9)
    inverse = np.linalg.inv(rows[:, free].T @ rows[:, free])
    covariance = found.at.covariance()
    assert covariance is not None
    assert covariance[np.ix_(free, free)] == pytest.approx(inverse, rel=1e-9)
    assert not covariance[1].any()


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_eliminated_parameters_take_the_step_of_the_whole_system(
    damping: float, random: np.random.Generator
) -> None:
    frames, own, shared = 4, 2, 3
    designs = random.standard_normal((frames, 12, own + shared))
    residuals = random.standard_normal((frames, 12))
    size = shared + frames * own
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for i, (design, residual) in enumerate(zip(designs, residuals, strict=True)):
        columns = [*range(shared + own * i, shared + own * (i + 1)), *range(shared)]
        normal[np.ix_(columns, columns)] += design.T @ design
        gradient[columns] += design.T @ residual
    by_own, by_shared = designs[:, :, :own], designs[:, :, own:]
    at = BorderedEquations(
        p=np.zeros(size),
        objective=0.0,
        shared=normal[:shared, :shared],
        own=np.einsum("nmo,nmp->nop", by_own, by_own),
        mixed=np.einsum("nmo,nms->nos", by_own, by_shared),
        shared_gradient=gradient[:shared],
        own_gradient=gradient[shared:].reshape(frames, own),
    )
    step = at.step(damping)
    assert step is not None
    expected = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
    assert step.change == pytest.approx(expected, rel=1e-9)
    assert step.length == pytest.approx(np.sqrt(-expected @ gradient), rel=1e-9)
    covariance = np.linalg.inv(normal)[:shared, :shared]
    assert at.shared_covariance() == pytest.approx(covariance, rel=1e-9)


def test_a_damped_step_is_short_far_from_a_minimum() -> None:
    # The domain ends before the minimum at 4, which no step reaches.
    def rows(p: Floats) -> Rows | None:
        return Rows(np.array([p[0] - 4.0]), np.ones((1, 1))) if p[0] <= 0.01 else None

    assert not fit_rows(rows, np.zeros(1), step_sigmas=0.01).converged


def test_undetermined_frames_have_no_step_and_no_covariance() -> None:
    zero = np.zeros((1, 1))

    def system(own: float, mixed: float) -> BorderedEquations:
        return BorderedEquations(
            p=np.zeros(2),
            objective=0.0,
            shared=np.ones((1, 1)),
            own=np.full((1, 1, 1), own),
            mixed=np.full((1, 1, 1), mixed),
            shared_gradient=np.ones(1),
            own_gradient=zero,
        )

    assert system(0.0, 0.0).step(0.0) is None
    assert system(0.0, 0.0).shared_covariance() is None
    # Indefinite by rounding.
    assert system(1.0, 1 + 1e-12).step(0.0) is None
    assert np.isnan(system(1.0, 1 + 1e-12).length)
    assert system(1.0, 1 + 1e-12).step(1e-3) is not None
