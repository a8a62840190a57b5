"""Compute normal equations of a beam that bends in plane C, in one pass, without the Jacobian.

A curve in a plane has four parameters: its q, and the shift of its contact's tangent across
itself, along itself, and its rotation. The slopes of the misfit by these are 1, P', and two more of
`residuals.curve_misfit`. The five parameters of a fit only change these four numbers, so sums of
products of the four slopes and the residual contain all information of the points, and the chain
rule gives the normal equations.
"""

from typing import Any

import numpy as np

from solver.beams.exact import BEND_GENTLE, BEND_STEEP, GENTLE, STEEP, bend_at
from solver.instrument.arrays import Floats
from solver.instrument.compiled import FAST, njit
from solver.uniform.residuals import (
    DX,
    DY,
    LEVER,
    SIGMA_X,
    SIGMA_Y,
    TILT,
    Q,
    X,
    Y,
    curve_end,
    curve_misfit,
    is_gentle,
    weight_of,
)


@njit
def plane_equations(
    p: Floats, points: Floats, residual: Floats, normal: Floats, gradient: Floats
) -> float:
    """Compute J^T J (8, 8), J^T r (8,), r (n,) of the points; return the sum of squares.

    They equal those of `point_residuals` for psi zero and held: its row and column stay zero.
    """
    q, lever = p[Q], p[LEVER]
    base, base_tangent, base_by_q = bend_at(lever, q)
    sine = q * lever * lever / 2
    cosine = np.sqrt(1 - sine * sine)
    theta_q, theta_lever = lever * lever / 2 / cosine, q * lever / cosine
    cos_tilt, sin_tilt = np.cos(p[TILT]), np.sin(p[TILT])
    c, s = cos_tilt * cosine - sin_tilt * sine, sin_tilt * cosine + cos_tilt * sine
    mx, my, sx, sy = points[X], points[Y], points[SIGMA_X], points[SIGMA_Y]
    if is_gentle(p):
        chi2, by_residual, products = _sums(
            p, base, c, s, mx, my, sx, sy, BEND_GENTLE, GENTLE, residual
        )
    else:
        chi2, by_residual, products = _sums(
            p, base, c, s, mx, my, sx, sy, BEND_STEEP, STEEP, residual
        )
    # Derivatives of the curve's shift across, shift along, rotation and q by each parameter.
    chain = (
        (base_by_q, 0.0, theta_q, 1.0),
        (base_tangent, -1.0, theta_lever, 0.0),
        (0.0, 0.0, 0.0, 0.0),
        (s, -c, 0.0, 0.0),
        (-c, -s, 0.0, 0.0),
        (0.0, 0.0, 1.0, 0.0),
    )
    normal[:] = 0.0
    gradient[:] = 0.0
    for a in range(TILT + 1):
        gradient[a] = _inner(chain[a], by_residual)
        by_1, by_2 = _inner(chain[a], products[0]), _inner(chain[a], products[1])
        by_3, by_4 = _inner(chain[a], products[2]), _inner(chain[a], products[3])
        for b in range(a + 1):
            normal[a, b] = normal[b, a] = _inner(chain[b], (by_1, by_2, by_3, by_4))
    return float(chi2)


@njit(inline="always")
def _inner(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@njit(fastmath=FAST)
def _sums(
    p: Floats,
    base: float,
    cosine: float,
    sine: float,
    mx: Floats,
    my: Floats,
    sx: Floats,
    sy: Floats,
    series: tuple[float, ...],
    max_versine: float,
    residual: Floats,
) -> Any:
    """Sum r^2 (), r times the four slopes (4,), and the slopes' products (4, 4).

    Each sum is a separate scalar, so that all stay in registers.
    """
    q, lever, dx, dy = p[Q], p[LEVER], p[DX], p[DY]
    max_distance = curve_end(q, max_versine)
    rr = r1 = r2 = r3 = r4 = s11 = s12 = s13 = s14 = s22 = s23 = s24 = s33 = s34 = s44 = 0.0
    for i in range(mx.size):
        along = cosine * (mx[i] - dx) + sine * (my[i] - dy)
        across = cosine * (my[i] - dy) - sine * (mx[i] - dx)
        value, by_along, by_rotation, by_q = curve_misfit(
            along, across, q, lever, max_distance, max_versine, series
        )
        sigma_along, sigma_across = cosine * sx[i] + sine * sy[i], cosine * sy[i] - sine * sx[i]
        # The slope by `across` (1) over sigma; then the other slopes, and the residual.
        w1 = weight_of(by_along * sigma_along + sigma_across)
        w2, w3, w4 = by_along * w1, by_rotation * w1, by_q * w1
        r = (base + value) * w1
        residual[i] = r
        rr += r * r
        r1, r2, r3, r4 = r1 + r * w1, r2 + r * w2, r3 + r * w3, r4 + r * w4
        s11, s12, s13 = s11 + w1 * w1, s12 + w1 * w2, s13 + w1 * w3
        s14, s22, s23 = s14 + w1 * w4, s22 + w2 * w2, s23 + w2 * w3
        s24, s33, s34 = s24 + w2 * w4, s33 + w3 * w3, s34 + w3 * w4
        s44 += w4 * w4
    products = (
        (s11, s12, s13, s14),
        (s12, s22, s23, s24),
        (s13, s23, s33, s34),
        (s14, s24, s34, s44),
    )
    return rr, (r1, r2, r3, r4), products
