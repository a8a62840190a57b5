"""Compute starts of a frame's fit: from a few points or, with outliers, from random draws.

A `problem` and its units are those of `fit`.
"""

from typing import Any, Final

import numpy as np

from solver.core.least_squares import DEFICIENT
from solver.instrument.arrays import Floats, copy_into
from solver.instrument.compiled import FAST, njit
from solver.uniform.minimise import minimise
from solver.uniform.residuals import (
    LEVER,
    PARAMETERS,
    PSI,
    SIGMA_X,
    SIGMA_Y,
    TILT,
    FrameArrays,
    Q,
    X,
    Y,
    is_feasible,
    point_residuals,
)

_START_POINTS: Final = 32
_DISTANCES: Final = 20
# Number of draws. Chosen: if half of the points are outliers, one draw of three points in eight has
# none, and none of 150 has with a probability of 2e-9.
_DRAWS: Final = 150
# Largest q lever^2 of a start: twice the sine of the slope at the contact, 53 degrees. Chosen:
# well inside the domain of the model, where steps in all directions are possible.
MAX_START: Final = 1.6
# Maximum iterations of a start and of a draw. A numpy scalar is compiled once, a literal for every
# value.
_START_ITERATIONS, _DRAW_ITERATIONS = np.int64(3), np.int64(8)
_PLANAR = np.bool_(False)
# Number of times that the load of a start without a shape is reduced by a fifth. Chosen: by a
# factor of 7,500 in all.
_SHORTENINGS: Final = 40


@njit(fastmath=FAST)
def _moments(sample: Floats, x_c: float) -> Any:
    """Sum the weighted unit deflection's square, times x and times y, over a sample."""
    ss = sx = sy = 0.0
    for j in range(sample.shape[1]):
        x = sample[0, j]
        near = min(x, x_c)
        # (3 x_c - x) x^2 up to the contact, (3 x - x_c) x_c^2 beyond it, in one formula.
        shape = (3 * max(x, x_c) - near) * near * near
        weighted = sample[1, j] * shape
        ss, sx, sy = ss + weighted * shape, sx + weighted * x, sy + sample[2, j] * shape
    return ss, sx, sy


@njit
def fit_linear_start(points: Floats, indices: Any, tilt_variance: float, p: Floats) -> None:
    """Fit the nearest linear beam to the points at `indices`; write (q, lever) and tilt to p.

    Eqs. (9), (10) are fitted over a grid of contact distances, with amplitude and tilt by linear
    least squares. This is repeated, at most twice, in axes rotated by the estimated tilt if that
    is 0.02 rad or more.
    """
    rotation, sample = 0.0, np.empty((3, len(indices)))
    for _ in range(3):
        c, s = np.cos(rotation), np.sin(rotation)
        best, lever, amplitude, tilt = np.inf, 0.5, 0.0, 0.0
        # The tilt's prior is centred on zero in the axes that are not rotated.
        xx = 1 / tilt_variance
        xy, yy = -rotation / tilt_variance, rotation * rotation / tilt_variance
        for j in range(len(indices)):
            i = indices[j]
            x = c * points[X, i] + s * points[Y, i]
            y = c * points[Y, i] - s * points[X, i]
            weight = 1 / max(points[SIGMA_X, i] ** 2 + points[SIGMA_Y, i] ** 2, 1e-18)
            sample[0, j], sample[1, j], sample[2, j] = x, weight, weight * y
            xx, xy, yy = xx + weight * x * x, xy + weight * x * y, yy + weight * y * y
        for k in range(_DISTANCES):
            # The grid is denser near the clamp, where a contact bends a shorter stretch.
            x_c = ((k + 0.7) / (_DISTANCES - 0.3)) ** 2
            ss, sx, sy = _moments(sample, x_c)
            determinant = ss * xx - sx * sx
            if not determinant > 1e-12 * ss * xx:
                continue
            a, b = (sy * xx - xy * sx) / determinant, (xy * ss - sy * sx) / determinant
            if a <= 0:
                continue
            cost = yy - a * sy - b * xy
            if cost < best:
                best, lever, amplitude, tilt = cost, x_c, a, b
        rotation += tilt
        if abs(tilt) < 0.02:
            break
    p[:] = 0.0
    p[TILT] = rotation
    p[LEVER] = lever
    p[Q] = max(min(6 * amplitude, MAX_START / lever**2), 1e-9)


@njit
def subset(problem: Any, indices: Any) -> Any:
    """Return the problem with only the points at `indices`."""
    points, view, tips, known, base_whitening = problem
    sample = np.empty((4, len(indices)))
    for j in range(len(indices)):
        for row in range(4):
            sample[row, j] = points[row, indices[j]]
    return FrameArrays(sample, view, tips, known, base_whitening)


@njit
def workspace(n: int) -> Any:
    """Allocate residual, Jacobian, weight and scratch of n points."""
    return np.empty(n), np.empty((6, n)), np.ones(n), np.empty(n)


def initial_estimate(
    problem: FrameArrays, free: Any, tilt_variance: float, psi: float
) -> Floats | None:
    """Compute a start (8,) from equally spaced points, refined by least squares on them.

    `free` does not contain psi, which is held. Return None if there is no start.
    """
    points, view = problem.points, problem.viewpoint
    stride = max(points.shape[1] // _START_POINTS, 1)
    indices = np.arange(stride // 2, points.shape[1], stride)
    p = np.zeros(PARAMETERS)
    fit_linear_start(points, indices, tilt_variance, p)
    p[PSI] = psi
    for _ in range(_SHORTENINGS):
        if is_feasible(p, points, view):
            break
        p[Q] *= 0.8
    else:
        return None
    if stride > 1:
        sparse_problem = subset(problem, indices)
        covariance = np.empty((PARAMETERS, PARAMETERS))
        minimise(
            p, sparse_problem, free, np.inf, _START_ITERATIONS, workspace(len(indices)), covariance
        )
    return p if is_feasible(p, points, view) else None


@njit
def consensus(
    problem: Any, free: Any, tilt_variance: float, psi: float, cut: float, work: Any, p: Floats
) -> bool:
    """Find the best exact beam through a few points (MSAC); write it to p.

    The draws are the same in every call. Returns False if no draw gives a beam.
    """
    points, view = problem.points, problem.viewpoint
    n, jacobian = points.shape[1], work[1]
    residual = work[0][:n]
    size = 2 if tilt_variance < 1e-4 else 3
    indices = np.empty(size, dtype=np.int64)
    covariance = np.empty((PARAMETERS, PARAMETERS))
    trial = np.empty(PARAMETERS)
    draw_work = workspace(size)
    best, state = np.inf, 12345
    for _ in range(_DRAWS):
        for j in range(size):
            # Draw one point from each part of the beam, so that they are far apart.
            state = (1103515245 * state + 12345) % 2147483648
            fraction = (j + state / 2147483648) / size
            indices[j] = min(int(fraction * n), n - 1)
        fit_linear_start(points, indices, tilt_variance, trial)
        trial[PSI] = psi
        if not is_feasible(trial, points, view):
            continue
        drawn_problem = subset(problem, indices)
        status, _, _ = minimise(
            trial, drawn_problem, free, np.inf, _DRAW_ITERATIONS, draw_work, covariance
        )
        if status == DEFICIENT or not is_feasible(trial, points, view):
            continue
        point_residuals(trial, points, view, _PLANAR, residual, jacobian)
        cost = 0.0
        for r in residual:
            cost += min(r * r, cut * cut)
        if cost < best:
            best = cost
            copy_into(p, trial)
    return best < np.inf
