"""Least squares with linear theory: all visible points at once, eqs. (9) and (10).

This method is not in the paper. It is the best use of linear theory, a reference for the averages
of pairs and triples. Given x_c the load and the clamp's offset, tilt and place are linear
parameters; they are eliminated, which leaves a search in x_c alone (variable projection, Golub and
Pereyra 1973). At the eliminated parameters' optimum the derivative of the projected sum of squares
is the partial derivative of the full one; its root is searched for by Brent's method, in a bracket
that grows from the nearest bend of a grid.

Each point has its own sigma across the beam. The clamp's pose has the prior of the rest image and
the rig's tolerances. Linear theory neglects that the beam foreshortens and turns: on a real beam
x_c is biased outwards, by +0.05 to +0.3 % of L at 5 % deflection, +0.2 to +1.2 % at 10 % and
+0.9 to +5 % at 20 %, while the residuals are only a few hundredths of a pixel. The covariance is
that of noise, clamp and rig and does not include this bias.
"""

import math

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import brentq

from solver.baselines.linear_estimate import (
    BASE,
    LOAD,
    X_C,
    LinearContact,
    estimate_from_linear_fit,
    planar_bend,
    stated_errors,
)
from solver.beams.linear import unit_deflection, unit_deflection_by_contact, unit_slope
from solver.core.correlation import correlation_length
from solver.fitting.first_contact import Bend
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

MIN_POINTS = 8
# The load enters the clamp's prior and the points' errors; it is known well after two rounds.
ROUNDS = 2


def linear_fit(measurement: Measurement) -> Estimate:
    """Estimate contact distance x_c, force f and derived values, with their joint covariance."""
    prepared = planar_bend(measurement, MIN_POINTS)
    if isinstance(prepared, Estimate):
        return prepared
    planar, bend = prepared
    length = planar.rig.beam.length
    projection = _Projection(planar, bend)
    iterations = 0
    for _ in range(ROUNDS):
        root = _root(projection, bend.x_c, length)
        if isinstance(root, str):
            return Estimate(Outcome.NOT_IDENTIFIABLE, root)
        x_c, steps = root
        iterations += steps
        linear = projection.linear(x_c)
        if linear[0] <= 0:
            return Estimate(Outcome.NOT_IDENTIFIABLE, "the estimated load is not positive")
        projection = _Projection(planar, Bend(x_c, float(linear[0]), bend.significance))
    return _estimate(planar, projection, x_c, iterations)


class _Projection:
    """Problem with the linear parameters (load, load dx, dy, tilt) eliminated, in sigmas."""

    def __init__(self, planar: Measurement, bend: Bend) -> None:
        self.x, self.y = planar.points.T
        slope = bend.amplitude * unit_slope(self.x, bend.x_c) + bend.tilt
        across = np.abs(planar.sigma_vectors[:, 1] - slope * planar.sigma_vectors[:, 0])
        size = np.linalg.norm(planar.sigma_vectors, axis=1)
        # An error along the beam is not observable; 1 nm per metre keeps weights finite.
        self.weight = 1 / np.maximum(across, np.maximum(1e-3 * size, 1e-9 * planar.rig.beam.length))
        # A clamp at dx shifts the shape: -dx load u'. With load dx as the unknown this is linear.
        self.load = bend.amplitude
        scale = np.array([self.load, 1.0, 1.0])
        covariance = planar.base_covariance * np.outer(scale, scale)
        self.prior = np.asarray(
            solve_triangular(np.linalg.cholesky(covariance), np.eye(3), lower=True)
        )
        self.target = np.concatenate([self.weight * self.y, np.zeros(3)])

    def design(self, x_c: float) -> Floats:
        """Compute the columns (n + 3, 4) of load, load dx, dy and tilt."""
        columns = np.zeros((len(self.x) + 3, 4))
        shape = [unit_deflection(self.x, x_c), -unit_slope(self.x, x_c), np.ones_like(self.x)]
        columns[:-3] = np.column_stack([*shape, self.x]) * self.weight[:, None]
        columns[-3:, 1:] = self.prior
        return columns

    def linear(self, x_c: float) -> Floats:
        """Solve for the linear parameters (4,) at a contact distance, by least squares."""
        columns = self.design(x_c)
        scale = np.linalg.norm(columns, axis=0)
        orthogonal, upper = np.linalg.qr(columns / scale)
        solution = solve_triangular(upper, orthogonal.T @ self.target) / scale
        return np.asarray(solution, dtype=np.float64)

    def by_contact(self, x_c: float, linear: Floats) -> Floats:
        """Compute d(model)/d x_c (n + 3,) at fixed linear parameters."""
        inside = self.x <= x_c
        by_shape = unit_deflection_by_contact(self.x, x_c)
        by_slope = np.where(inside, 6 * self.x, 6 * x_c)
        column = np.zeros(len(self.x) + 3)
        column[:-3] = self.weight * (linear[0] * by_shape - linear[1] * by_slope)
        return column

    def residual(self, x_c: float, linear: Floats) -> Floats:
        """Compute measured less modelled (n + 3,), in sigmas; the last three are the prior's."""
        return np.asarray(self.target - self.design(x_c) @ linear)

    def descent(self, x_c: float) -> float:
        """Compute -1/2 d(sum of squares)/d x_c, positive where the contact is farther out."""
        linear = self.linear(x_c)
        return float(self.residual(x_c, linear) @ self.by_contact(x_c, linear))


def _root(projection: _Projection, start: float, length: float) -> tuple[float, int] | str:
    """Find the minimum nearest to `start` [m] as the root of the derivative; count evaluations.

    Returns a message instead if there is no minimum between the clamp and far beyond the tip.
    """
    step = 0.02 * length
    low, high = start, start
    descent = projection.descent(start)
    evaluations = 1
    while projection.descent(low) <= 0:
        low, step, evaluations = low - step, 1.5 * step, evaluations + 1
        if low <= 0.001 * length:
            return "the contact would be at the clamp"
    step = 0.02 * length
    while descent > 0:
        high, step, evaluations = high + step, 1.5 * step, evaluations + 1
        if high > 4 * length:
            return "the contact would be far beyond the tip"
        descent = projection.descent(high)
    if low == high:
        return low, evaluations
    root, report = brentq(
        projection.descent, low, high, xtol=1e-13 * length, rtol=1e-13, full_output=True
    )
    return float(root), evaluations + int(report.function_calls)


def _estimate(
    planar: Measurement, projection: _Projection, x_c: float, iterations: int
) -> Estimate:
    linear = projection.linear(x_c)
    load = float(linear[0])
    residual = projection.residual(x_c, linear)
    chi2, dof = float(residual @ residual), len(planar.points) - 2
    # Residuals larger than the stated sigmas inflate the covariance; smaller ones do not reduce it.
    in_order = residual[:-3][np.argsort(planar.points[:, 0], kind="stable")]
    variance_inflation = max(chi2 / dof, 1.0) * correlation_length(in_order)
    jacobian = np.column_stack([projection.by_contact(x_c, linear), projection.design(x_c)])
    size = np.linalg.norm(jacobian, axis=0)
    # The errors that all points share move the fit too.
    gain = np.linalg.pinv(jacobian / size)[:, :-3] / size[:, None]
    moved = gain @ planar.view.shared_errors
    # The variance inflation applies to the points, not to the prior.
    jacobian[:-3] /= math.sqrt(variance_inflation)
    scale = np.linalg.norm(jacobian, axis=0)
    _, singular, right = np.linalg.svd(jacobian / scale, full_matrices=False)
    if singular[-1] < 1e-10 * singular[0]:
        return Estimate(Outcome.NOT_IDENTIFIABLE, iterations=iterations)
    root = (right.T / singular) / scale[:, None]
    fitted = root @ root.T + moved @ moved.T  # of x_c, load, load dx, dy, tilt
    dx = float(linear[1]) / load
    to_clamp = np.eye(5)
    to_clamp[2, 1:3] = [-dx / load, 1 / load]
    fitted = to_clamp @ fitted @ to_clamp.T
    covariance = stated_errors(planar)
    rows = np.r_[X_C, LOAD, np.arange(8)[BASE]]
    covariance[np.ix_(rows, rows)] = fitted
    contact = LinearContact(x_c, load, covariance, base=(dx, float(linear[2]), float(linear[3])))
    return estimate_from_linear_fit(contact, planar, chi2=chi2, dof=dof, iterations=iterations)
