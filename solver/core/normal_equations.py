"""Normal equations of a weighted sum of squares with a prior, and their damped solution.

This module is compiled.
"""

from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import FAST, njit
from solver.instrument.small_matrices import dot, solve_definite


@njit(fastmath=FAST)
def _weighted(a: Floats, weight: Floats, out: Floats) -> None:
    for i in range(a.size):
        out[i] = a[i] * weight[i]


@njit
def add_rows(
    residual: Floats, jacobian: Floats, weight: Floats, place: Any, gradient: Floats, normal: Floats
) -> None:
    """Add J^T W r to `gradient` (f,) and J^T W J to `normal` (f, f), of rows with `weight` (n,).

    The row j of the Jacobian (k, n) is by the parameter `place[j]` (k,), or by a fixed one if that
    is negative.
    """
    row = np.empty(len(residual))
    for j in range(len(jacobian)):
        a = place[j]
        if a < 0:
            continue
        _weighted(jacobian[j], weight, row)
        gradient[a] += dot(row, residual)
        for k in range(j + 1):
            b = place[k]
            if b >= 0:
                value = dot(row, jacobian[k])
                normal[a, b] += value
                if k < j:
                    normal[b, a] += value


@njit
def add_prior(
    p: Floats, mean: Floats, information: Floats, free: Any, gradient: Floats, normal: Floats
) -> float:
    """Add a prior with `mean` (p,) and `information` (p, p); return its sum of squares at p (p,).

    `free` (f,) are the parameters of `gradient` (f,) and `normal` (f, f).
    """
    away = p - mean
    total = 0.0
    for i in range(len(p)):
        total += away[i] * dot(information[i], away)
    for a in range(len(free)):
        gradient[a] += dot(information[free[a]], away)
        for b in range(len(free)):
            normal[a, b] += information[free[a], free[b]]
    return total


@njit
def scaled_step(normal: Floats, gradient: Floats, damping: float, step: Floats) -> float:
    """Write the solution (f,) of (N + damping diag N) step = -gradient; return its length.

    The length is in sigmas; it is NaN where N is not positive definite. The columns are scaled to
    one, so that units have no effect.
    """
    n = len(gradient)
    scaled, unit = np.empty((n, n)), np.empty(n)
    for a in range(n):
        unit[a] = np.sqrt(max(normal[a, a], 1e-300))
    for a in range(n):
        for b in range(n):
            scaled[a, b] = normal[a, b] / (unit[a] * unit[b])
        scaled[a, a] += damping
        step[a] = -gradient[a] / unit[a]
    if not solve_definite(scaled, step):
        return np.nan
    decrease = 0.0
    for a in range(n):
        step[a] /= unit[a]
        decrease -= step[a] * gradient[a]
    return float(np.sqrt(max(decrease, 0.0)))
