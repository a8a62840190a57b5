"""Errors that neighbouring points share, where the residuals of a frame show them.

A ground with structure, shadows, grime and light from an object move the points of a stretch of the
beam alike. The covariance for independent errors is then too small, and the more so the more
freedom the beam has to imitate them. They are modelled as a random course along the beam, linear
between nodes, of Matern's correlation of order 3/2, which describes smooth courses and rough ones.
Its sigma and correlation length are those of the largest restricted likelihood (Patterson and
Thompson 1971), which allows for what the fit of the beam has taken from the residuals.

An object beside the beam takes light from one of its flanks and moves its apparent middle by a part
of its radius, in proportion to the light that is lost: such a course is multiplied by that.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import eigh

from solver.fitting.frame_problem import FrameProblem, P, with_own_errors
from solver.fitting.robust_fit import residuals_at
from solver.instrument.arrays import Floats
from solver.uniform.residuals import LEAST_SIGMA, SIGMA_X, SIGMA_Y, X, Y


class _Courses(NamedTuple):
    """Courses that are compared, by `nodes` along the beam.

    Their correlation lengths are over the beam's length.
    """

    nodes: int
    lengths: tuple[float, ...]
    sigmas: Floats


# Chosen: nodes about ten pixels of an image apart; correlation lengths from that of independent
# nodes to errors that are almost a bend of the beam. Sigmas are in sigmas of a point: the
# likelihood changes little by a factor of two; smaller ones are hidden by the points' own errors,
# larger ones are outliers.
EVEN: Final = _Courses(32, (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4), np.geomspace(0.1, 6.4, 7))
# Chosen: nodes two or three pixels apart, because what is seen between two leaves may be ten pixels
# long, with errors of both signs. Sigmas are in radii of the beam, for all of its light: where one
# half of a matt beam is dark, its middle moves by 0.4 of them.
SHADED: Final = _Courses(128, (1 / 128, 1 / 64, 1 / 32), np.geomspace(0.0125, 0.8, 7))
# Share of the light that a shaded point lacks at least. Chosen: a beam that bends changes its
# brightness by less.
LEAST_LOSS: Final = 0.05
# Fewest points that are. Chosen: noise makes neighbours darker, as far as their median reaches.
LEAST_SHADED: Final = 6
# Twice the gain of log likelihood that shows such errors. Derived: 0.1 % of chi^2 with one degree
# of freedom.
MIN_GAIN: Final = 10.8


class Neighbours(NamedTuple):
    """A random course along the beam.

    Its correlation `length`, over the beam's length, its `sigma`, and twice the log likelihood that
    it gains. The sigma is in sigmas of a point or, for a `shaded` beam, in radii for all its light.
    """

    length: float
    sigma: float
    gain: float
    shaded: bool = False


def is_shaded(lost_light: Floats) -> bool:
    """Test whether points with these shares (n,) of `lost_light` may have moved by it."""
    return int(np.count_nonzero(lost_light > LEAST_LOSS)) >= LEAST_SHADED


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
    scatter = float(np.sqrt(max(float(np.mean(steps**2)) / 2, 1.0))) if len(steps) else 1.0
    residual, by_free = residual[used] / scatter, jacobian[free][:, used] / scatter
    information = problem.information / scatter**2
    normal = by_free @ by_free.T + information[np.ix_(free, free)]
    unit = np.sqrt(np.diag(normal))
    if not (unit > 0).all():
        return None
    by_free, normal = by_free / unit[:, None], normal / np.outer(unit, unit)
    pull = (information @ (p - problem.mean))[free] / unit
    # At the least squares of these points, from which a robust fit differs.
    residual -= by_free.T @ np.linalg.lstsq(normal, by_free @ residual + pull)[0]
    found = _most_likely(EVEN, residual, _hats(problem, EVEN)[used], by_free, normal)
    found = found._replace(sigma=found.sigma * scatter)
    if is_shaded(problem.lost_light[kept[:points]]):
        hats = _hats(problem, SHADED)[used] / scatter
        shaded = _most_likely(SHADED, residual, hats, by_free, normal)
        if shaded.gain > found.gain + MIN_GAIN:
            found = shaded._replace(shaded=True)
    return found if found.gain > MIN_GAIN else None


def _most_likely(
    courses: _Courses, residual: Floats, hats: Floats, by_free: Floats, normal: Floats
) -> Neighbours:
    """Find the course of the largest restricted likelihood; without gain if it grows without end.

    `residual` (n,) are those of least squares, with the Jacobian `by_free` (f, n) and the matrix
    `normal` (f, f) of their equations; `hats` (n, nodes) interpolate the course.
    """
    mixed = by_free @ hats
    left = hats.T @ hats - mixed.T @ np.linalg.lstsq(normal, mixed)[0]
    roots = np.array([_root(length, courses.nodes) for length in courses.lengths])
    left = np.swapaxes(roots, 1, 2) @ left @ roots
    # NumPy's OpenBLAS uses threads from about 28 rows on, which wait for each other where other
    # programs run. Measured: a frame then took 15 to 25 ms in place of 9; alone, as long as here.
    found = [eigh(one, check_finite=False, driver="evd") for one in left]
    values, vectors = (np.array(part) for part in zip(*found, strict=True))
    size = ((hats.T @ residual) @ roots)[:, None] @ vectors  # (lengths, 1, nodes)
    square = courses.sigmas[:, None] ** 2
    widened = 1 + square * np.maximum(values, 0.0)[:, None]  # (lengths, sigmas, nodes)
    gains = (square * size**2 / widened - np.log(widened)).sum(axis=2)
    length, sigma = np.unravel_index(int(np.argmax(gains)), gains.shape)
    # The beam's own prior may be violated by more than such errors are: then there is no largest
    # likelihood, and a course of any size would take all that the frame shows.
    within = sigma < len(courses.sigmas) - 1
    gain = float(gains[length, sigma]) if within else 0.0
    return Neighbours(courses.lengths[length], float(courses.sigmas[sigma]), gain)


def with_neighbours(problem: P, neighbours: Neighbours) -> P:
    """Add the errors that neighbouring points share, as errors of the frame's own."""
    courses = SHADED if neighbours.shaded else EVEN
    course = _hats(problem, courses) @ _root(neighbours.length, courses.nodes)
    return with_own_errors(problem, neighbours.sigma * course)


def _hats(problem: FrameProblem, courses: _Courses) -> Floats:
    """Compute the interpolation (n, nodes) from values at nodes to the residuals.

    Places are distances from the clamp, over the beam's length; it is 0 for what is no point.
    """
    place = np.hypot(problem.points[X], problem.points[Y]) * (courses.nodes - 1)
    hats = np.zeros((len(problem.shared), courses.nodes))
    apart = np.abs(np.minimum(place, courses.nodes - 1)[:, None] - np.arange(courses.nodes))
    hats[: len(place)] = np.maximum(1 - apart, 0)
    if courses is SHADED:
        sigmas = np.hypot(problem.points[SIGMA_X], problem.points[SIGMA_Y])
        radii = problem.beam.radius / np.maximum(sigmas, LEAST_SIGMA)
        hats[: len(place)] *= (problem.lost_light * radii)[:, None]
    return hats


@lru_cache
def _root(length: float, nodes: int) -> Floats:
    """Compute a root (nodes, nodes) of the correlation of a course's values at the nodes."""
    node = np.arange(nodes)
    scaled = np.sqrt(3) * np.abs(node[:, None] - node) / (nodes - 1) / length
    return np.asarray(np.linalg.cholesky((1 + scaled) * np.exp(-scaled)))
