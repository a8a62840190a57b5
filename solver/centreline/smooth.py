"""Robust smooth courses along the beam: a curve and a running median."""

from typing import Any

import numpy as np

from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.compiled import FAST, njit
from solver.instrument.medians import SIGMA_OVER_MAD, median
from solver.instrument.small_matrices import dot, solve_definite

MAX_ITERATIONS = 12
# A numpy scalar is compiled once, a literal for every value.
DEGREE = np.int64(7)
# For a beam at rest: bow, sag and lens distortion have no finer detail.
REST_DEGREE = np.int64(4)
# For a beam that is bent by more than one contact, whose curvature has several kinks.
FINE_DEGREE = np.int64(15)
# Points this far apart err independently in compressed images, whose blocks have 8 or 16 pixels.
LAG = 16


@njit
def curve(x: Floats, y: Floats, sigma: Floats, at: Floats, degree: Any, cut: float) -> Floats:
    """Fit a smooth curve to y (n,) at x (n,) where sigma (n,) is finite; evaluate it at `at` (m,).

    The curve is a polynomial of at most `degree`, lower where points are few or span little of x,
    fitted by iteratively reweighted least squares (Beaton and Tukey 1974). Beyond the outermost
    known points it is constant. Points farther off than `cut` times their typical scatter have zero
    weight. Return an empty array with too few points.
    """
    empty = np.empty(0)
    known_x, known_y, known_sigma = np.empty(len(x)), np.empty(len(x)), np.empty(len(x))
    low, high, count = np.inf, -np.inf, 0
    lowest, highest = np.inf, -np.inf
    for i in range(len(x)):
        lowest, highest = min(lowest, x[i]), max(highest, x[i])
        if np.isfinite(sigma[i]):
            known_x[count], known_y[count], known_sigma[count] = x[i], y[i], sigma[i]
            low, high, count = min(low, x[i]), max(high, x[i]), count + 1
    if count < THRESHOLDS.min_curve_points or high <= low:
        return empty
    span = (high - low) / max(highest - lowest, 1e-300)
    max_degree = degree if span > 0.6 else 5 if span > 0.3 else 3 if span > 0.1 else 1
    terms = min(degree, max_degree, count // 4) + 1
    basis = _chebyshev(known_x[:count], low, high, terms)
    coefficients = _reweighted(basis, known_y[:count], known_sigma[:count], cut)
    for coefficient in coefficients:
        if not np.isfinite(coefficient):
            return empty
    return _combined(coefficients, _chebyshev(at, low, high, terms))


@njit
def _reweighted(basis: Floats, y: Floats, sigma: Floats, cut: float) -> Floats:
    """Fit coefficients of a basis (terms, n); NaN where the points do not determine them."""
    terms, n = basis.shape
    weight, weighted = np.ones(n), np.empty(n)
    typical_sigma = median(sigma)
    normal, solution = np.empty((terms, terms)), np.empty(terms)
    coefficients = np.full(terms, np.nan)
    previous_scale = np.inf
    n_used = n
    for _ in range(MAX_ITERATIONS):
        if n_used <= terms + 1:
            return np.full(terms, np.nan)
        for j in range(terms):
            solution[j] = _weighted(weight, basis[j], y, weighted)
            for k in range(j + 1):
                normal[j, k] = normal[k, j] = dot(weighted, basis[k])
            normal[j, j] *= 1 + 1e-12
        if not solve_definite(normal, solution):
            return np.full(terms, np.nan)
        coefficients = solution.copy()
        residual, n_near = _combined(coefficients, basis), 0
        for i in range(n):
            residual[i] = abs(y[i] - residual[i])
            n_near += SIGMA_OVER_MAD * residual[i] <= typical_sigma
        # To test by a count that the median is below `typical_sigma` is faster than to compute it.
        scale = typical_sigma
        if 2 * n_near <= n:
            scale = max(SIGMA_OVER_MAD * median(residual), typical_sigma)
        n_used = 0
        for i in range(n):
            u = residual[i] / (cut * scale)
            weight[i] = (1 - u * u) ** 2 if u < 1 else 0.0
            n_used += u < 1
        if abs(scale - previous_scale) < 1e-3 * scale:
            break
        previous_scale = scale
    return coefficients


@njit(fastmath=FAST)
def _weighted(weight: Floats, row: Floats, y: Floats, weighted: Floats) -> float:
    """Write a weighted row into `weighted`; return its product with y."""
    total = 0.0
    for i in range(row.size):
        weighted[i] = weight[i] * row[i]
        total += weighted[i] * y[i]
    return total


@njit
def _chebyshev(x: Floats, low: float, high: float, terms: int) -> Floats:
    """Evaluate Chebyshev polynomials (terms, n) of the places x (n,), clipped to low and high."""
    basis = np.ones((terms, len(x)))
    if terms > 1:
        for i in range(len(x)):
            basis[1, i] = 2 * (min(max(x[i], low), high) - low) / (high - low) - 1
    for j in range(2, terms):
        for i in range(len(x)):
            basis[j, i] = 2 * basis[1, i] * basis[j - 1, i] - basis[j - 2, i]
    return basis


@njit(fastmath=FAST)
def _combined(coefficients: Floats, basis: Floats) -> Floats:
    """Sum the rows of a basis (terms, n), each times its coefficient."""
    total = np.zeros(basis.shape[1])
    for j in range(len(coefficients)):
        for i in range(total.size):
            total[i] += coefficients[j] * basis[j, i]
    return total


@njit
def local_scatter(residual: Floats) -> float:
    """Estimate the standard deviation of residuals (n,) against neighbours; 0 for n below 8.

    Each value is compared with the mean of those LAG places before and after it, so that errors
    that vary slowly along the beam, such as model errors, do not count. The median makes it robust.
    """
    n = len(residual)
    lag = min(LAG, n // 4)
    if lag < 2:
        return 0.0
    difference = residual[lag : n - lag] - (residual[: n - 2 * lag] + residual[2 * lag :]) / 2
    return float(SIGMA_OVER_MAD * median(np.abs(difference)) / np.sqrt(1.5))


@njit
def running_median(values: Floats, width: Any) -> Floats:
    """Compute the median (n,) of `width` (odd) values about each one; end values are repeated.

    The window is sorted, and moves along.
    """
    n, half = len(values), width // 2
    medians = np.empty(n)
    window = np.empty(2 * half + 1)
    for i in range(n):
        if i == 0:
            for k in range(len(window)):
                window[k] = values[min(max(k - half, 0), n - 1)]
            for k in range(1, len(window)):  # insertion: sort() takes a second to compile
                value, place = window[k], k
                while place > 0 and window[place - 1] > value:
                    window[place] = window[place - 1]
                    place -= 1
                window[place] = value
        else:
            _exchange(window, values[max(i - half - 1, 0)], values[min(i + half, n - 1)])
        medians[i] = window[half]
    return medians


@njit
def _exchange(window: Floats, old: float, new: float) -> None:
    """Replace a value of a sorted window by another, and keep it sorted."""
    k = 0
    while window[k] < old:
        k += 1
    while k + 1 < len(window) and window[k + 1] < new:
        window[k] = window[k + 1]
        k += 1
    while k > 0 and window[k - 1] > new:
        window[k] = window[k - 1]
        k -= 1
    window[k] = new
