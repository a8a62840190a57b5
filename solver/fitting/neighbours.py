"""Errors that neighbouring points share, where the residuals of a frame show them.

A ground with structure, shadows, grime and light from an object move the points of a stretch of the
beam alike. The covariance for independent errors is then too small, and the more so the more
freedom the beam has to imitate them. They are modelled as a random course along the beam, linear
between equidistant nodes, whose values at the nodes are independent. Its sigma and the number of
nodes are those of the largest restricted likelihood (Patterson and Thompson 1971), which allows for
what the fit of the beam has taken from the residuals.
"""

from typing import Final, NamedTuple

import numpy as np

from solver.fitting.residuals import X, Y
from solver.fitting.rod_fit import residuals_at
from solver.fitting.rod_problem import RodProblem, with_own_errors
from solver.instrument.arrays import Floats

# Numbers of nodes along the beam. Chosen: from errors that are almost a bend of the beam to those
# of about ten pixels of an image.
NODES: Final = (8, 16, 32)
# Sigmas at the nodes, in sigmas of a point. Chosen: the likelihood changes little by a factor of
# two; smaller ones are hidden by the points' own errors, larger ones are outliers.
SIGMAS: Final = np.geomspace(0.1, 6.4, 7)
# Twice the gain of log likelihood that shows such errors. Derived: 0.1 % of chi^2 with one degree
# of freedom.
MIN_GAIN: Final = 10.8


class Neighbours(NamedTuple):
    """A random course along the beam: its number of nodes, and their sigma in sigmas of a point."""

    nodes: int
    sigma: float


def neighbours_of(problem: RodProblem, p: Floats, kept: Floats) -> Neighbours | None:
    """Find the errors that neighbouring points share, from a fit p (p,) of a frame.

    `kept` (n,) are its points without outliers, in the order of the problem. Return None where
    independent errors explain the residuals.
    """
    rows = residuals_at(problem, p)
    if rows is None:
        return None
    residual, jacobian = rows
    free, points = problem.free, problem.points.shape[1]
    used = np.ones(len(residual), bool)
    used[:points] = kept[:points]
    # Points may scatter by more than their sigmas, independently of each other.
    steps = np.diff(residual[:points][used[:points]])
    scatter = np.sqrt(max(float(np.mean(steps**2)) / 2, 1.0)) if len(steps) else 1.0
    residual, by_free = residual[used] / scatter, jacobian[free][:, used] / scatter
    normal = by_free @ by_free.T + problem.information[np.ix_(free, free)] / scatter**2
    unit = np.sqrt(np.diag(normal))
    if not (unit > 0).all():
        return None
    by_free, normal = by_free / unit[:, None], normal / np.outer(unit, unit)
    best, gain = None, MIN_GAIN
    for nodes in NODES:
        course = _course(problem, nodes)[used]
        mixed = by_free @ course
        left = course.T @ course - mixed.T @ np.linalg.lstsq(normal, mixed)[0]
        values, vectors = np.linalg.eigh((left + left.T) / 2)
        size = vectors.T @ (course.T @ residual)
        for sigma in SIGMAS:
            widened = 1 + sigma**2 * np.maximum(values, 0.0)
            likelihood = float((sigma**2 * size**2 / widened - np.log(widened)).sum())
            if likelihood > gain:
                best, gain = Neighbours(nodes, float(sigma * scatter)), likelihood
    return best


def with_neighbours(problem: RodProblem, neighbours: Neighbours) -> RodProblem:
    """Add the errors that neighbouring points share, as errors of the frame's own."""
    return with_own_errors(problem, neighbours.sigma * _course(problem, neighbours.nodes))


def _course(problem: RodProblem, nodes: int) -> Floats:
    """Compute the course at the residuals (n, nodes) by the values at its nodes, 0 beyond points.

    Places are distances from the clamp, over the beam's length.
    """
    place = np.hypot(problem.points[X], problem.points[Y]) * (nodes - 1)
    every = np.arange(nodes)
    course = np.zeros((len(problem.shared), nodes))
    course[: len(place)] = np.maximum(1 - np.abs(np.clip(place, 0, nodes - 1)[:, None] - every), 0)
    return course
