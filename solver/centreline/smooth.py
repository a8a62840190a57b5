"""Robust smooth courses along the beam: a curve and a running median."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.dot_products import FAST, dot

FEWEST = 8
ROUNDS = 12
DEGREE = 7
# Tukey's biweight is 0 beyond this many times the points' own scatter.
CUT = 6.0
# Points this far apart err independently in compressed images, whose blocks have 8 or 16 pixels.
LAG = 16


def smooth_curve(x: Floats, y: Floats, sigma: Floats, degree: int = DEGREE) -> Floats | None:
    """Fit a smooth curve at x (n,) to y (n,) where sigma (n,) is finite.

    The curve is a polynomial of at most `degree`, lower where points are few or span little of x,
    fitted by iteratively reweighted least squares (Beaton and Tukey 1974). Beyond the outermost
    known points it is constant. Points farther off than CUT times their typical scatter have zero
    weight. Return None with too few points.
    """
    found: Floats = curve(x, y, sigma, x, degree, CUT)
    return found if len(found) else None


@njit(cache=True, error_model="numpy")
def curve(x: Floats, y: Floats, sigma: Floats, at: Floats, degree: int, cut: float) -> Floats:
    """Fit as `smooth_curve`, and evaluate at `at`; return an empty array where that fails."""
    none = np.empty(0)
    known = np.flatnonzero(np.isfinite(sigma))
    if len(known) < FEWEST:
        return none
    low, high = x[known].min(), x[known].max()
    spanned = (high - low) / max(x.max() - x.min(), 1e-300)
    if spanned <= 0:
        return none
    most = 7 if spanned > 0.6 else 5 if spanned > 0.3 else 3 if spanned > 0.1 else 1
    terms = min(degree, most, len(known) // 4) + 1
    basis = _chebyshev(2 * (x[known] - low) / (high - low) - 1, terms)
    coefficients = _reweighted(basis, y[known], sigma[known], cut)
    if not np.isfinite(coefficients).all():
        return none
    inside = 2 * (np.minimum(np.maximum(at, low), high) - low) / (high - low) - 1
    return coefficients @ _chebyshev(inside, terms)


@njit(cache=True, error_model="numpy")
def _reweighted(basis: Floats, y: Floats, sigma: Floats, cut: float) -> Floats:
    """Fit coefficients of a basis (terms, n); NaN where the points do not determine them."""
    terms, n = basis.shape
    weight, weighted = np.ones(n), np.empty(n)
    usual = np.median(sigma)
    normal, right = np.empty((terms, terms)), np.empty(terms)
    coefficients = np.full(terms, np.nan)
    before = np.inf
    for _ in range(ROUNDS):
        if np.count_nonzero(weight) <= terms + 1:
            return np.full(terms, np.nan)
        for j in range(terms):
            right[j] = _weighted(weight, basis[j], y, weighted)
            for k in range(j + 1):
                normal[j, k] = normal[k, j] = dot(weighted, basis[k])
            normal[j, j] *= 1 + 1e-12
        coefficients = np.linalg.solve(normal, right)
        off = np.abs(y - coefficients @ basis)
        # Testing by a count that the median is below `usual` is much faster than computing it.
        scale = usual
        if 2 * np.count_nonzero(1.4826 * off <= usual) <= n:
            scale = max(1.4826 * np.median(off), usual)
        for i in range(n):
            u = off[i] / (cut * scale)
            weight[i] = (1 - u * u) ** 2 if u < 1 else 0.0
        if abs(scale - before) < 1e-3 * scale:
            break
        before = scale
    return coefficients


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _weighted(weight: Floats, row: Floats, y: Floats, weighted: Floats) -> float:
    """Write a weighted row into `weighted`; return its product with y."""
    total = 0.0
    for i in range(row.size):
        weighted[i] = weight[i] * row[i]
        total += weighted[i] * y[i]
    return total


@njit(cache=True, error_model="numpy")
def _chebyshev(place: Floats, terms: int) -> Floats:
    """Evaluate Chebyshev polynomials (terms, n) at places from -1 to 1."""
    basis = np.ones((terms, len(place)))
    if terms > 1:
        basis[1] = place
    for j in range(2, terms):
        basis[j] = 2 * place * basis[j - 1] - basis[j - 2]
    return basis


@njit(cache=True, error_model="numpy")
def local_scatter(residual: Floats) -> float:
    """Estimate the standard deviation of residuals (n,) against neighbours; 0 for n below 8.

    Each value is compared with the mean of those LAG places before and after it, so that errors
    that vary slowly along the beam, such as model errors, do not count. The median makes it robust.
    """
    n = len(residual)
    lag = min(LAG, n // 4)
    if lag < 2:
        return 0.0
    off = residual[lag : n - lag] - (residual[: n - 2 * lag] + residual[2 * lag :]) / 2
    return float(1.4826 * np.median(np.abs(off)) / np.sqrt(1.5))


@njit(cache=True, error_model="numpy")
def running_median(values: Floats, width: int) -> Floats:
    """Compute the median (n,) of `width` (odd) values about each; end values are repeated."""
    n, half = len(values), width // 2
    medians = np.empty(n)
    window = np.empty(2 * half + 1)
    for i in range(n):
        if i == 0:
            for k in range(len(window)):
                window[k] = values[min(max(k - half, 0), n - 1)]
            window.sort()
        else:
            _exchange(window, values[max(i - half - 1, 0)], values[min(i + half, n - 1)])
        medians[i] = window[half]
    return medians


@njit(cache=True, error_model="numpy")
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
