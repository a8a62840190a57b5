"""Errors that neighbouring points share, where the residuals of a frame show them.

A ground with structure, shadows, grime and light from an object move the points of a stretch of the
beam alike. The covariance for independent errors is then too small, and the more so the more
freedom the beam has to imitate them. They are modelled as a random course along the beam, linear
between nodes, of Matern's correlation of order 3/2, which describes smooth courses and rough ones.
Its sigma and correlation length are those of the largest restricted likelihood (Patterson and
Thompson 1971), which allows for what the fit of the beam has taken from the residuals.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import eigh

from solver.fitting.frame_problem import FrameProblem, P, with_own_errors
from solver.fitting.robust_fit import residuals_at
from solver.instrument.arrays import Floats
from solver.uniform.residuals import X, Y

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


def neighbours_of(problem: FrameProblem, p: Floats, kept: Floats) -> Neighbours | None:
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
    pull = (information @ (p - problem.mean))[free] / unit
    hats = _hats(problem)[used]
    mixed = by_free @ hats
    taken = np.linalg.lstsq(normal, np.column_stack([by_free @ residual + pull, mixed]))[0]
    # At the least squares of these points, from which a robust fit differs.
    residual -= by_free.T @ taken[:, 0]
    left = hats.T @ hats - mixed.T @ taken[:, 1:]
    roots = np.array([_root(length) for length in LENGTHS])
    left = np.swapaxes(roots, 1, 2) @ left @ roots
    # NumPy's OpenBLAS uses threads from about 28 rows on, which wait for each other where other
    # programs run. Measured: a frame then took 15 to 25 ms in place of 9; alone, as long as here.
    found = [eigh(one, check_finite=False, driver="evd") for one in left]
    values, vectors = (np.array(part) for part in zip(*found, strict=True))
    size = ((hats.T @ residual) @ roots)[:, None] @ vectors  # (lengths, 1, nodes)
    square = SIGMAS[:, None] ** 2
    widened = 1 + square * np.maximum(values, 0.0)[:, None]  # (lengths, sigmas, nodes)
    gains = (square * size**2 / widened - np.log(widened)).sum(axis=2)
    length, sigma = np.unravel_index(int(np.argmax(gains)), gains.shape)
    if gains[length, sigma] <= MIN_GAIN:
        return None
    return Neighbours(LENGTHS[length], float(SIGMAS[sigma] * scatter), float(gains[length, sigma]))


def with_neighbours(problem: P, neighbours: Neighbours) -> P:
    """Add the errors that neighbouring points share, as errors of the frame's own."""
    course = _hats(problem) @ _root(neighbours.length)
    return with_own_errors(problem, neighbours.sigma * course)


def _hats(problem: FrameProblem) -> Floats:
    """Compute the interpolation (n, NODES) from values at nodes to the residuals.

    Places are distances from the clamp, over the beam's length; it is 0 for what is no point.
    """
    place = np.hypot(problem.points[X], problem.points[Y]) * (NODES - 1)
    hats = np.zeros((len(problem.shared), NODES))
    apart = np.abs(np.minimum(place, NODES - 1)[:, None] - np.arange(NODES))
    hats[: len(place)] = np.maximum(1 - apart, 0)
    return hats


@lru_cache
def _root(length: float) -> Floats:
    """Compute a root (NODES, NODES) of the correlation of a course's values at the nodes."""
    node = np.arange(NODES)
    scaled = np.sqrt(3) * np.abs(node[:, None] - node) / (NODES - 1) / length
    return np.asarray(np.linalg.cholesky((1 + scaled) * np.exp(-scaled)))
