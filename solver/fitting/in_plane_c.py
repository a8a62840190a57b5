"""Normal equations of a beam that bends in plane C, in one pass and without the Jacobian.

A curve in a plane has four parameters: its q, and the shift of its contact's tangent across
itself, along itself, and its rotation. The slopes of the misfit by these are 1, P', and two more of
`residuals.off_the_curve`. The five parameters of a fit only change these four numbers, so sums of
products of the four slopes and the residual contain all information of the points, and the chain
rule gives the normal equations.
"""

from typing import Any

import numpy as np

from solver.beam_models.exact import BEND_GENTLE, BEND_STEEP, GENTLE, STEEP, bend_at
from solver.fitting.residuals import (
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
    is_gentle,
    off_the_curve,
    weight_of,
)
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.instrument.dot_products import FAST


@njit
def plane_equations(
    p: Floats, points: Floats, bounds: Any, residual: Floats, normal: Floats, gradient: Floats
) -> float:
    """Compute J^T J (8, 8), J^T r (8,), r (n,) of all views' points; return the sum of squares.

    They equal those of `point_residuals` for psi zero and held: its row and column stay zero.
    """
    q, lever = p[Q], p[LEVER]
    base, base_tangent, base_by_q = bend_at(lever, q)
    sine = q * lever * lever / 2
    cosine = np.sqrt(1 - sine * sine)
    theta_q, theta_lever = lever * lever / 2 / cosine, q * lever / cosine
    cos_tilt, sin_tilt = np.cos(p[TILT]), np.sin(p[TILT])
    c, s = cos_tilt * cosine - sin_tilt * sine, sin_tilt * cosine + cos_tilt * sine
    views = slice(bounds[0], bounds[-1])
    mx, my = points[X, views], points[Y, views]
    sx, sy = points[SIGMA_X, views], points[SIGMA_Y, views]
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
        one, two = _inner(chain[a], products[0]), _inner(chain[a], products[1])
        three, four = _inner(chain[a], products[2]), _inner(chain[a], products[3])
        for b in range(a + 1):
            normal[a, b] = normal[b, a] = _inner(chain[b], (one, two, three, four))
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
    widest: float,
    residual: Floats,
) -> Any:
    """Sum r^2 (), r times the four slopes (4,), and the slopes' products (4, 4).

    Each sum is a separate scalar, so that all stay in registers.
    """
    q, lever, dx, dy = p[Q], p[LEVER], p[DX], p[DY]
    farthest = curve_end(q, widest)
    rr = r1 = r2 = r3 = r4 = s11 = s12 = s13 = s14 = s22 = s23 = s24 = s33 = s34 = s44 = 0.0
    for i in range(mx.size):
        along = cosine * (mx[i] - dx) + sine * (my[i] - dy)
        across = cosine * (my[i] - dy) - sine * (mx[i] - dx)
        value, by_along, by_turn, by_q = off_the_curve(
            along, across, q, lever, farthest, widest, series
        )
        sigma_along, sigma_across = cosine * sx[i] + sine * sy[i], cosine * sy[i] - sine * sx[i]
        # The slope by `across` (1) over sigma; then the other slopes, and the residual.
        one = weight_of(by_along * sigma_along + sigma_across)
        two, three, four = by_along * one, by_turn * one, by_q * one
        r = (base + value) * one
        residual[i] = r
        rr += r * r
        r1, r2, r3, r4 = r1 + r * one, r2 + r * two, r3 + r * three, r4 + r * four
        s11, s12, s13 = s11 + one * one, s12 + one * two, s13 + one * three
        s14, s22, s23 = s14 + one * four, s22 + two * two, s23 + two * three
        s24, s33, s34 = s24 + two * four, s33 + three * three, s34 + three * four
        s44 += four * four
    products = (
        (s11, s12, s13, s14),
        (s12, s22, s23, s24),
        (s13, s23, s33, s34),
        (s14, s24, s34, s44),
    )
    return rr, (r1, r2, r3, r4), products
