"""Fit of a uniform beam with two contacts to one frame: problem, residuals and starts."""

import math
from collections.abc import Iterator
from itertools import combinations
from typing import Any, Final

import numpy as np

from solver.beam_models.two_contacts import (
    PARAMETERS,
    Q_INNER,
    Q_OUTER,
    S_INNER,
    S_OUTER,
    two_contacts_of,
)
from solver.fitting.problem import Problem
from solver.fitting.residuals import LEAST_SIGMA, SIGMA_X, SIGMA_Y, X, Y
from solver.fitting.rod_problem import RodProblem
from solver.fitting.rod_residuals import DX, DY, POSE, PSI, TILT, curve_residuals
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.measurement import Measurement

# Places of the grid of starts, in units of the beam's length, and points that it uses. Chosen:
# the fit moves a contact by more than a step of the grid.
_GRID: Final = np.linspace(0.06, 0.98, 24)
_POINTS: Final = 64
# Starts differ in a place by more than this many steps of the grid. Chosen: nearer ones lead to the
# same minimum.
_APART: Final = 3


_FORCES: Final = [Q_OUTER, Q_INNER]
_PLACES: Final = [S_OUTER, S_INNER]


class TwoContactProblem(RodProblem):
    """Points of one frame and the prior, for the shapes of `two_contacts`."""

    @property
    def positive(self) -> tuple[int, ...]:
        """Indices of the contacts' places: the forces may have either sign."""
        return (S_OUTER, S_INNER)

    def moved(self, p: Floats, step: Floats) -> Floats:
        """Return the parameters (p,) after a step (p,); NaN where no two contacts have its moments.

        In linear theory the beam before both contacts depends on the forces' moments about the
        clamp of order 0 and 1, beyond them on those of order 2 and 3, and linearly on all four. A
        step is therefore straight in the moments, which follow the curved valley of the objective.
        """
        moved = p + step
        by_force, by_place = _moments(p)
        moments = by_force @ (p[_FORCES] + step[_FORCES]) + by_place @ step[_PLACES]
        moved[:PARAMETERS] = np.nan
        # The two places are the nodes of Gauss's quadrature with these moments.
        determinant = moments[0] * moments[2] - moments[1] ** 2
        if determinant != 0:
            total = (moments[0] * moments[3] - moments[1] * moments[2]) / determinant
            product = (moments[1] * moments[3] - moments[2] ** 2) / determinant
            root = total**2 - 4 * product
            if root > 0:
                outer, inner = (total + math.sqrt(root)) / 2, (total - math.sqrt(root)) / 2
                moved[S_OUTER], moved[S_INNER] = outer, inner
                moved[Q_OUTER] = (moments[1] - inner * moments[0]) / (outer - inner)
                moved[Q_INNER] = moments[0] - moved[Q_OUTER]
        return moved

    def residuals(self, p: Floats, residual: Floats, jacobian: Floats) -> bool:
        """Write the residuals (n,) of shape and pose p, and their Jacobian."""
        arrays = self.points, self.bounds, self.views
        return bool(_residuals(p, *arrays, residual, jacobian))


def _moments(p: Floats) -> tuple[Floats, Floats]:
    """Compute the derivatives (4, 2) of the forces' moments of order 0 to 3, by force and place."""
    order = np.arange(4)[:, None]
    forces, places = p[_FORCES], p[_PLACES]
    by_place = order * forces * places ** np.maximum(order - 1, 0)
    return places**order, by_place


@njit
def _residuals(
    p: Floats, points: Floats, bounds: Any, views: Floats, residual: Floats, jacobian: Floats
) -> bool:
    """Write the residuals and their Jacobian; return whether the shape exists."""
    curve, _, _ = two_contacts_of(p[:PARAMETERS])
    # The clamp of a uniform beam is rigid, so that its moment does not turn it.
    return curve.exists and curve_residuals(
        p, curve, 0.0, np.zeros(PARAMETERS), points, bounds, views, residual, jacobian
    )


def two_contact_problem_of(measurement: Measurement, problem: Problem) -> TwoContactProblem:
    """Return the problem of two contacts with the points of `problem`, in the known plane."""
    points, bounds, views, *_ = problem.arrays
    shared = problem.shared_errors
    pose, errors = PARAMETERS + DX, PARAMETERS + POSE
    mean = np.zeros(errors + shared.shape[1])
    mean[PARAMETERS + PSI] = measurement.handedness * (measurement.rig.known_psi or 0.0)
    information = np.zeros((len(mean), len(mean)))
    length = measurement.rig.beam.length
    unit = np.array([length, length, 1.0])
    clamp = slice(pose, PARAMETERS + TILT + 1)
    # In units of the sigmas, which differ by orders of magnitude.
    sigmas = np.sqrt(np.diag(measurement.base_covariance))
    correlation = measurement.base_covariance / np.outer(sigmas, sigmas)
    weights = unit / sigmas
    information[clamp, clamp] = np.linalg.inv(correlation) * np.outer(weights, weights)
    own = np.arange(errors, len(mean))
    information[own, own] = 1.0
    return TwoContactProblem(
        points=points,
        bounds=bounds - bounds[0],
        views=views,
        widths=0,
        radius=measurement.rig.beam.radius / length,
        shared=shared,
        mean=mean,
        information=information,
        free=np.array([*range(PARAMETERS), *range(pose, PARAMETERS + TILT + 1), *own]),
    )


def starts_of(problem: TwoContactProblem, tilt: float, count: int) -> Iterator[Floats]:
    """Yield up to `count` starts (p,), the best first, of a beam whose clamp is turned by `tilt`.

    Each is the best linear beam, eqs. (9) and (10) superposed, with contacts at two places of a
    grid; offset and tilt of the clamp are fitted with their prior. Linear theory is applied to the
    integral of the tangent's angle over the arc length, whose second derivative is the curvature
    for any deflection.
    """
    last = problem.bounds[1]
    points = problem.points[:, : last : max(last // _POINTS, 1)]
    weight = 1 / np.maximum(np.hypot(points[SIGMA_X], points[SIGMA_Y]), LEAST_SIGMA)
    s, y = _unrolled(points, tilt)
    near = np.minimum(s, _GRID[:, None])
    # The deflection by a force of 6 EI: (3 a - s) s^2 up to its place a, (3 s - a) a^2 beyond.
    bends = (3 * np.maximum(s, _GRID[:, None]) - near) * near**2 * weight
    clamp = np.array([weight, s * weight])
    rows = [PARAMETERS + DY, PARAMETERS + TILT]
    inverse = np.linalg.inv(clamp @ clamp.T + problem.information[np.ix_(rows, rows)])
    # Eliminate the clamp (Schur complement).
    columns = np.concatenate([bends, [y * weight]])
    by_clamp = columns @ clamp.T
    normal = columns @ columns.T - by_clamp @ inverse @ by_clamp.T
    pairs = np.array(list(combinations(range(len(_GRID)), 2)))
    one, other = pairs.T
    norm, mixed, other_norm = normal[one, one], normal[one, other], normal[other, other]
    determinant = np.maximum(norm * other_norm - mixed**2, 1e-12 * norm * other_norm + 1e-300)
    right = normal[pairs, -1]
    forces = np.column_stack(
        [
            (other_norm * right[:, 0] - mixed * right[:, 1]) / determinant,
            (norm * right[:, 1] - mixed * right[:, 0]) / determinant,
        ]
    )
    # Reduction of the sum of squares by each pair.
    gains = (forces * right).sum(axis=1)
    for _ in range(count):
        best = int(np.argmax(gains))
        start = problem.mean.copy()
        start[[S_INNER, S_OUTER]] = _GRID[pairs[best]]
        start[[Q_INNER, Q_OUTER]] = 6 * forces[best]
        start[PARAMETERS + TILT] = tilt
        yield start
        gains[(np.abs(pairs - pairs[best]) <= _APART).all(axis=1)] = -np.inf


def _unrolled(points: Floats, tilt: float) -> tuple[Floats, Floats]:
    """Compute arc length (n,), and integral (n,) of the tangent's angle over it, at sorted points.

    The angle is against the direction of `tilt`.
    """
    cosine, sine = np.cos(tilt), np.sin(tilt)
    x = np.concatenate([[0.0], cosine * points[X] + sine * points[Y]])
    y = np.concatenate([[0.0], cosine * points[Y] - sine * points[X]])
    step = np.hypot(np.diff(x), np.diff(y))
    angle = np.arctan2(np.diff(y), np.diff(x))
    return np.cumsum(step), y[1:] + np.cumsum((angle - np.sin(angle)) * step)
