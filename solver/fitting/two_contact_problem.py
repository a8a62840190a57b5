"""Fit of a beam with two contacts to one frame: problem, residuals and starts."""

import math
from collections.abc import Iterator
from itertools import combinations
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid

from solver.beam_models.rod import FRICTION_RATIO, S_C, WIDTHS, Q
from solver.beam_models.rod_stretch import width_at
from solver.beam_models.two_contacts import INNER_PARAMETERS, STEPS, two_contacts_of
from solver.fitting.residuals import LEAST_SIGMA, SIGMA_X, SIGMA_Y, X, Y
from solver.fitting.rod_problem import RodProblem
from solver.fitting.rod_residuals import DY, POSE, TILT, curve_residuals
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Places of the grid of starts, in units of the beam's length, and points that it uses. Chosen:
# the fit moves a contact by more than a step of the grid.
_GRID: Final = np.linspace(0.06, 0.98, 24)
_POINTS: Final = 64
# Starts differ in a place by more than this many steps of the grid. Chosen: nearer ones lead to the
# same minimum.
_APART: Final = 3
# Points of the integration of a linear beam. Chosen: its error is far below a step of the grid.
_FINE: Final = 100


class TwoContactProblem(RodProblem):
    """Points of one frame and the prior, for the shapes of `two_contacts`."""

    @property
    def forces(self) -> tuple[int, int]:
        """Indices of the forces, the outer one first."""
        return Q, self.shape_size - 3

    @property
    def places(self) -> tuple[int, int]:
        """Indices of the contacts' places, the outer one first."""
        return S_C, self.shape_size - 2

    @property
    def positive(self) -> tuple[int, ...]:
        """Indices of the contacts' places: the forces may have either sign."""
        return self.places

    def moved(self, p: Floats, step: Floats) -> Floats:
        """Return the parameters (p,) after a step (p,); NaN where no two contacts have its moments.

        In linear theory the beam before both contacts depends on the forces' moments about the
        clamp of order 0 and 1, beyond them on those of order 2 and 3, and linearly on all four. A
        step is therefore straight in the moments, which follow the curved valley of the objective.
        """
        moved, forces, places = p + step, list(self.forces), list(self.places)
        by_force, by_place = _moments(p[forces], p[places])
        moments = by_force @ (p[forces] + step[forces]) + by_place @ step[places]
        moved[[*forces, *places]] = np.nan
        # The two places are the nodes of Gauss's quadrature with these moments.
        determinant = moments[0] * moments[2] - moments[1] ** 2
        if determinant != 0:
            total = (moments[0] * moments[3] - moments[1] * moments[2]) / determinant
            product = (moments[1] * moments[3] - moments[2] ** 2) / determinant
            root = total**2 - 4 * product
            if root > 0:
                outer, inner = (total + math.sqrt(root)) / 2, (total - math.sqrt(root)) / 2
                load = (moments[1] - inner * moments[0]) / (outer - inner)
                moved[places], moved[forces] = (outer, inner), (load, moments[0] - load)
        return moved

    def residuals(self, p: Floats, residual: Floats, jacobian: Floats) -> bool:
        """Write the residuals (n,) of shape and pose p, and their Jacobian."""
        arrays = self.points, self.view
        return bool(_residuals(p, *arrays, self.widths, self.radius, residual, jacobian))


def _moments(forces: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Compute the derivatives (4, 2) of the forces' moments of order 0 to 3, by force and place."""
    order = np.arange(4)[:, None]
    return places**order, order * forces * places ** np.maximum(order - 1, 0)


@njit
def _residuals(
    p: Floats,
    points: Floats,
    view: Floats,
    widths: int,
    radius: float,
    residual: Floats,
    jacobian: Floats,
) -> bool:
    """Write the residuals and their Jacobian; return whether the shape exists."""
    both = two_contacts_of(p[: len(p) - POSE], widths, radius, STEPS)
    return both.curve.exists and curve_residuals(
        p, both.curve, both.moment, both.by_moment, points, view, residual, jacobian
    )


def two_contact_problem_of(rod: RodProblem) -> TwoContactProblem:
    """Add an inner contact to the problem of one contact, with the same prior of its friction."""
    size = rod.shape_size
    added = [size] * INNER_PARAMETERS
    load, place, friction_ratio = range(size, size + INNER_PARAMETERS)
    information = np.insert(np.insert(rod.information, added, 0.0, axis=0), added, 0.0, axis=1)
    information[friction_ratio, friction_ratio] = rod.information[FRICTION_RATIO, FRICTION_RATIO]
    rubs = [friction_ratio] if FRICTION_RATIO in rod.free else []
    others = np.where(rod.free < size, rod.free, rod.free + INNER_PARAMETERS)
    return TwoContactProblem(
        points=rod.points,
        view=rod.view,
        widths=rod.widths,
        radius=rod.radius,
        shared=rod.shared,
        mean=np.insert(rod.mean, added, 0.0),
        information=information,
        free=np.sort([*others, load, place, *rubs]),
    )


def starts_of(problem: TwoContactProblem, tilt: float, count: int) -> Iterator[Floats]:
    """Yield up to `count` starts (p,), the best first, of a beam whose clamp is turned by `tilt`.

    Each is the best linear beam of the prior's section, with contacts at two places of a grid;
    offset and tilt of the clamp are fitted with their prior. Linear theory is applied to the
    integral of the tangent's angle over the arc length, whose second derivative is the curvature
    for any deflection.
    """
    points = problem.points[:, :: max(problem.points.shape[1] // _POINTS, 1)]
    weight = 1 / np.maximum(np.hypot(points[SIGMA_X], points[SIGMA_Y]), LEAST_SIGMA)
    s, y = _unrolled(points, tilt)
    size = problem.shape_size
    widths, bow = np.split(problem.mean[WIDTHS : size - INNER_PARAMETERS], [problem.widths])
    y = y - sum(b * s ** (2 + i) for i, b in enumerate(bow))
    bends = _bends(s, np.ascontiguousarray(widths)) * weight
    clamp = np.array([weight, s * weight])
    rows = [size + DY, size + TILT]
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
        start[list(problem.places)] = _GRID[pairs[best]][::-1]
        start[list(problem.forces)] = forces[best][::-1]
        start[size + TILT] = tilt
        yield start
        gains[(np.abs(pairs - pairs[best]) <= _APART).all(axis=1)] = -np.inf


def _bends(s: Floats, widths: Floats) -> Floats:
    """Compute the deflections (g, n) at arc lengths s (n,) by a force of EI at each of _GRID."""
    fine = np.linspace(0.0, max(float(s[-1]), _GRID[-1]), _FINE)
    terms = np.empty(len(widths))
    width = np.array([width_at(x, widths, terms)[0] for x in fine])
    curvature = np.maximum(_GRID[:, None] - fine, 0.0) / width**4
    slope = cumulative_trapezoid(curvature, fine, initial=0.0)
    deflections = cumulative_trapezoid(slope, fine, initial=0.0)
    return np.array([np.interp(s, fine, row) for row in deflections])


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
