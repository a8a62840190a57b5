"""Minimise by Gauss-Newton with step halving, for residuals already divided by their sigmas."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats

Linearised = tuple[Floats, Floats]


@dataclass(frozen=True)
class Fit:
    """Minimum: parameters (p,), covariance (p, p) = (J^T J)^-1, chi^2, iterations.

    `rank_deficient` is True if the data do not determine a direction of the parameters; the
    covariance is then meaningless.
    """

    parameters: Floats
    covariance: Floats
    chi2: float
    iterations: int
    converged: bool
    rank_deficient: bool


def gauss_newton(
    residuals: Callable[[Floats], Linearised | None],
    start: Floats,
    *,
    step_tolerance: float = 1e-3,
    most_iterations: int = 30,
) -> Fit:
    """Minimise the sum of squared residuals from `start`.

    `residuals(p)` returns (residuals (m,), Jacobian (m, p)), or None outside the model's domain;
    `start` must be inside. The iteration stops at a step shorter than `step_tolerance` sigmas: the
    noise, not the rounding, sets the tolerance. Raises ValueError if `start` is outside.
    """
    current = residuals(start)
    if current is None:
        raise ValueError("the start is outside the model's domain")
    parameters = start
    converged = False
    iteration = 0
    while iteration < most_iterations and not converged:
        iteration += 1
        residual, jacobian = current
        inverse, _ = _inverse_normal(jacobian)
        step = -inverse @ (jacobian.T @ residual)
        # Length of the step in sigmas, the natural unit of the problem.
        length = float(np.linalg.norm(jacobian @ step))
        accepted = _halved_until_downhill(residuals, parameters, step, residual)
        if accepted is None:
            converged = length < 1.0  # no descent: only rounding, if the step was short
            break
        parameters, current = accepted
        converged = length < step_tolerance
    residual, jacobian = current
    covariance, deficient = _inverse_normal(jacobian)
    return Fit(parameters, covariance, float(residual @ residual), iteration, converged, deficient)


def _halved_until_downhill(
    residuals: Callable[[Floats], Linearised | None],
    parameters: Floats,
    step: Floats,
    residual: Floats,
) -> tuple[Floats, Linearised] | None:
    chi2 = residual @ residual
    for halving in range(12):
        trial = parameters + step / 2**halving
        linearised = residuals(trial)
        if linearised is not None and linearised[0] @ linearised[0] <= chi2 * (1 + 1e-12):
            return trial, linearised
    return None


def _inverse_normal(jacobian: Floats) -> tuple[Floats, bool]:
    """Compute (J^T J)^-1, columns scaled to one so that units do not affect the rank test."""
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    _, singular, right = np.linalg.svd(jacobian / scale, full_matrices=False)
    deficient = bool(singular[-1] < 1e-9 * singular[0])
    truncated = np.where(singular > 1e-12 * singular[0], singular, np.inf)
    root = right.T / truncated
    return (root @ root.T) / np.outer(scale, scale), deficient
