"""A smooth curve through scattered centres, which the outer ones do not pull."""

import numpy as np
from numba import njit

from solver.instrument.arrays import Floats

FEWEST = 8
ROUNDS = 12
# Tukey's biweight cuts off at this many times the points' own scatter.
CUT = 6.0


def smooth_curve(
    x: Floats,
    y: Floats,
    sigma: Floats,
    at: Floats | None = None,
    degree: int = 7,
    cut: float = CUT,
) -> Floats | None:
    """The curve at x (n,), or at `at` (m,), through y (n,) where sigma (n,) is finite.

    A polynomial of at most `degree`, less where points are few or span little of x, by iteratively
    reweighted least squares (Beaton and Tukey 1974). Beyond the outermost known points it stays
    level. Points farther off than `cut` times their typical scatter have no say. None with too few
    points.
    """
    known = np.isfinite(sigma)
    count = int(np.count_nonzero(known))
    if count < FEWEST:
        return None
    low, high = x[known].min(), x[known].max()
    where = x if at is None else at
    extent = max(x.max() - x.min(), 1e-300)
    spanned = (high - low) / extent
    if spanned <= 0:
        return None
    most = 7 if spanned > 0.6 else 5 if spanned > 0.3 else 3 if spanned > 0.1 else 1
    terms = min(degree, most, count // 4) + 1
    place = 2 * (x[known] - low) / (high - low) - 1
    coefficients = _reweighted(place, y[known], sigma[known], terms, cut)
    if not np.isfinite(coefficients).all():
        return None
    inside = np.clip(2 * (where - low) / (high - low) - 1, -1.0, 1.0)
    return np.asarray(_chebyshev(inside, terms) @ coefficients)


@njit(cache=True, error_model="numpy")
def _reweighted(place: Floats, y: Floats, sigma: Floats, terms: int, cut: float) -> Floats:
    """Chebyshev coefficients (terms,); NaN where the points do not determine them."""
    n = len(place)
    basis = _chebyshev(place, terms)
    weight = np.ones(n)
    usual = np.median(sigma)
    coefficients = np.full(terms, np.nan)
    before = np.inf
    for _ in range(ROUNDS):
        if np.count_nonzero(weight) <= terms + 1:
            return np.full(terms, np.nan)
        normal, right = np.zeros((terms, terms)), np.zeros(terms)
        for i in range(n):
            for j in range(terms):
                wb = weight[i] * basis[i, j]
                right[j] += wb * y[i]
                for k in range(terms):
                    normal[j, k] += wb * basis[i, k]
        for j in range(terms):
            normal[j, j] *= 1 + 1e-12
        coefficients = np.linalg.solve(normal, right)
        off = np.abs(y - basis @ coefficients)
        scale = max(1.4826 * np.median(off), usual)
        for i in range(n):
            u = off[i] / (cut * scale)
            weight[i] = (1 - u * u) ** 2 if u < 1 else 0.0
        if abs(scale - before) < 1e-3 * scale:
            break
        before = scale
    return coefficients


@njit(cache=True, error_model="numpy")
def _chebyshev(place: Floats, terms: int) -> Floats:
    basis = np.ones((len(place), terms))
    for i in range(len(place)):
        for j in range(1, terms):
            below = place[i] if j == 1 else basis[i, j - 2]
            basis[i, j] = place[i] if j == 1 else 2 * place[i] * basis[i, j - 1] - below
    return basis
