"""Errors that neighbouring points share, where the residuals of a frame show them.

A ground with structure, shadows, grime and light from an object move the points of a stretch of the
beam alike. The covariance for independent errors is then too small, and the more so the more
freedom the beam has to imitate them. They are modelled as a random course along the beam, linear
between nodes, of Matern's correlation of order 3/2, which describes smooth courses and rough ones.
Its sigma and correlation length are those of the largest restricted likelihood (Patterson and
Thompson 1971), which allows for what the fit of the beam has taken from the residuals.
"""

from typing import Final, NamedTuple

import numpy as np

from solver.fitting.residuals import X, Y
from solver.fitting.rod_fit import residuals_at
from solver.fitting.rod_problem import P, RodProblem, with_own_errors
from solver.instrument.arrays import Floats

# Number of nodes along the beam. Chosen: about ten pixels of an image from one to the next.
NODES: Final = 32
# Correlation lengths, over the beam's length. Chosen: from that of independent nodes to errors that
# are almost a bend of the beam.
LENGTHS: Final = (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4)
# Sigmas of the course, in sigmas of a point. Chosen: the likelihood changes little by a factor of
# two; smaller ones are hidden by the points' own errors, larger ones are outliers.
SIGMAS: Final = np.geomspace(0.1, 6.4, 7)
# Twice the gain of log likelihood that shows such errors. Derived: 0.1 % of chi^2 with one degree
# of freedom.
MIN_GAIN: Final = 10.8


class Neighbours(NamedTuple):
    """A random course along the beam.

    Its correlation `length`, over the beam's length, its `sigma`, in sigmas of a point, and twice
    the log likelihood that it gains.
    """

    length: float
    sigma: float
    gain: float


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
    information = problem.information / scatter**2
    normal = by_free @ by_free.T + information[np.ix_(free, free)]
    unit = np.sqrt(np.diag(normal))
    if not (unit > 0).all():
        return None
    by_free, normal = by_free / unit[:, None], normal / np.outer(unit, unit)
    # At the least squares of these points, from which a robust fit differs.
    pull = (information @ (p - problem.mean))[free] / unit
    residual -= by_free.T @ np.linalg.lstsq(normal, by_free @ residual + pull)[0]
    best, gain = None, MIN_GAIN
    for length in LENGTHS:
        course = _course(problem, length)[used]
        mixed = by_free @ course
        left = course.T @ course - mixed.T @ np.linalg.lstsq(normal, mixed)[0]
        values, vectors = np.linalg.eigh((left + left.T) / 2)
        size = vectors.T @ (course.T @ residual)
        for sigma in SIGMAS:
            widened = 1 + sigma**2 * np.maximum(values, 0.0)
            likelihood = float((sigma**2 * size**2 / widened - np.log(widened)).sum())
            if likelihood > gain:
                best = Neighbours(length, float(sigma * scatter), likelihood)
                gain = likelihood
    return best


def with_neighbours(problem: P, neighbours: Neighbours) -> P:
    """Add the errors that neighbouring points share, as errors of the frame's own."""
    return with_own_errors(problem, neighbours.sigma * _course(problem, neighbours.length))


def _course(problem: RodProblem, length: float) -> Floats:
    """Compute the course at the residuals (n, NODES) by independent values of unit variance.

    Places are distances from the clamp, over the beam's length; the course is 0 beyond the points.
    """
    place = np.hypot(problem.points[X], problem.points[Y]) * (NODES - 1)
    node = np.arange(NODES)
    course = np.zeros((len(problem.shared), NODES))
    course[: len(place)] = np.maximum(1 - np.abs(np.clip(place, 0, NODES - 1)[:, None] - node), 0)
    apart = np.abs(node[:, None] - node) / (NODES - 1)
    scaled = np.sqrt(3) * apart / length
    return np.asarray(course @ np.linalg.cholesky((1 + scaled) * np.exp(-scaled)))
