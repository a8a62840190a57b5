"""Compute residuals of one frame, each divided by its sigma, with the exact Jacobian.

All lengths are in units of the beam's length L. Parameters, in this order:

    q, lever       the exact beam's shape
    psi            inclination of the deformation plane D against the calibration plane C
    dx, dy, tilt   the clamp's position on C, and the rotation of its tangent
    stretch        L is (1 + stretch) times its nominal value
    rigidity       EI is (1 + rigidity) times its nominal value

A point m is on the ray P = m + t (V_xyz - V_w m); with V_z = 1 the ray meets D at

    y = m_y / (cos(psi) - W_y sin(psi)),    x = m_x + W_x y sin(psi),    W = V_xy - V_w m,

in the clamp's axes: eqs. (7) and (8) of Kaneko, Kanayama and Tsuji (2001), for any viewpoint.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from solver.beams.exact import (
    BEND_GENTLE,
    BEND_STEEP,
    GENTLE,
    GENTLE_SINE,
    MOST_SINE,
    STEEP,
    bend_at,
    horner,
)
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.compiled import FAST, njit

Q, LEVER, PSI, DX, DY, TILT, STRETCH, RIGIDITY = range(8)
PARAMETERS: Final = 8
# Rows of `points`: intersection of the ray with C, and the one-sigma vector there.
X, Y, SIGMA_X, SIGMA_Y = range(4)
# Entries of `known`.
MOMENT, MOMENT_SIGMA, MOMENT_UNIT, STRETCH_SIGMA, RIGIDITY_SIGMA = range(5)
KNOWN: Final = 5
# Minimum sigma of a point, in units of L.
LEAST_SIGMA: Final = 1e-9


class FrameArrays(NamedTuple):
    """What the compiled fit knows of a frame, in units of the beam's length.

    `points` (4, n) and `viewpoint` (3,) are those of `point_residuals`; `tips` (k, 7), where k is
    0 or 1, `known` (5,) and `base_whitening` (3, 3) those of `constraints.add_constraints`.
    """

    points: Floats
    viewpoint: Floats
    tips: Floats
    known: Floats
    base_whitening: Floats


@njit
def is_feasible(
    p: Floats,
    points: Floats,
    view: Floats,
) -> bool:
    """Test whether the shape exists and every ray meets D on the side visible to the camera."""
    if not (p[Q] >= 0 and p[LEVER] > 0 and p[Q] * p[LEVER] ** 2 / 2 < MOST_SINE):
        return False
    if abs(p[PSI]) >= np.pi / 2:
        return False
    if p[PSI] == 0:
        return True
    sine, cosine = np.sin(p[TILT]), np.cos(p[TILT])
    vx, vy, vw = view
    low, high = np.inf, -np.inf
    for i in range(points.shape[1]):
        across = cosine * (vy - vw * points[Y, i]) - sine * (vx - vw * points[X, i])
        low, high = min(low, across), max(high, across)
    for across in (low, high):
        if np.cos(p[PSI]) - np.sin(p[PSI]) * across < THRESHOLDS.min_grazing:
            return False
    return True


@njit(inline="always")
def curve_misfit(
    along: float,
    across: float,
    q: float,
    lever: float,
    max_distance: float,
    max_versine: float,
    series: tuple[float, ...],
) -> tuple[float, float, float, float]:
    """Compute a point's misfit to the curve, less P(lever), and the slopes of that.

    The point's position from the clamp is along and across the contact's tangent. The slopes are
    by `along`, by the tangent's angle, and by q; by `across` it is 1. A point farther than
    `max_distance` from the contact is measured from the curve's end. `series` gives P where
    1 - cos(phi) <= `max_versine`, as in `exact`.
    """
    u = min(max(lever - along, 0.0), max_distance)
    s = q * u * u / 2
    c = np.sqrt(1 - s * s)
    secant = 1 / c
    tangent = s * secant
    shape = horner((1 - c) * (2 / max_versine) - 1, series)
    value = across - u * s / 3 * shape
    return value, tangent, tangent * across - along, u * u * u / 12 * (shape - 3 * secant)


@njit(inline="always")
def curve_end(q: float, max_versine: float) -> float:
    """Compute the largest distance from the contact at which the beam and its series are valid."""
    return float(
        np.sqrt(2 * min(MOST_SINE, np.sqrt(max_versine * (2 - max_versine))) / max(q, 1e-300))
    )


@njit(inline="always")
def weight_of(sigma: float) -> float:
    """Compute 1 / sigma with its sign: the residual is in units of the point's sigma vector."""
    return 1 / (sigma if abs(sigma) > LEAST_SIGMA else LEAST_SIGMA)


@njit(fastmath=FAST)
def _rows(
    p: Floats,
    mx: Floats,
    my: Floats,
    sx: Floats,
    sy: Floats,
    view: Floats,
    series: tuple[float, ...],
    max_versine: float,
    residual: Floats,
    by_q: Floats,
    by_lever: Floats,
    by_psi: Floats,
    by_dx: Floats,
    by_dy: Floats,
    by_tilt: Floats,
) -> None:
    q, lever = p[Q], p[LEVER]
    vx, vy, vw = view[0], view[1], view[2]
    cos_tilt, sin_tilt = np.cos(p[TILT]), np.sin(p[TILT])
    cos_psi, sin_psi = np.cos(p[PSI]), np.sin(p[PSI])
    sine = q * lever * lever / 2
    cosine = np.sqrt(1 - sine * sine)
    theta_q, theta_lever = lever * lever / 2 / cosine, q * lever / cosine
    base, base_tangent, base_by_q = bend_at(lever, q)
    max_distance = curve_end(q, max_versine)
    dx, dy = p[DX], p[DY]
    for i in range(mx.size):
        rotated_x = cos_tilt * (mx[i] - dx) + sin_tilt * (my[i] - dy)
        rotated_y = cos_tilt * (my[i] - dy) - sin_tilt * (mx[i] - dx)
        ray_x = cos_tilt * (vx - vw * mx[i]) + sin_tilt * (vy - vw * my[i])
        ray_y = cos_tilt * (vy - vw * my[i]) - sin_tilt * (vx - vw * mx[i])
        k = 1 / (cos_psi - sin_psi * ray_y)
        y = rotated_y * k
        x = rotated_x + sin_psi * ray_x * y
        along, across = x * cosine + y * sine, y * cosine - x * sine
        value, tangent, by_theta, curve_by_q = curve_misfit(
            along, across, q, lever, max_distance, max_versine, series
        )
        by_x, by_y = tangent * cosine - sine, cosine + tangent * sine
        # Derivatives by y, x following along the ray, and by the ray's direction.
        by_y += by_x * sin_psi * ray_x
        by_ray_x, by_ray_y = by_x * sin_psi * y, by_y * k * y * sin_psi
        by_k = by_y * k
        rotated_sx, rotated_sy = (
            cos_tilt * sx[i] + sin_tilt * sy[i],
            cos_tilt * sy[i] - sin_tilt * sx[i],
        )
        sigma = (by_x - vw * by_ray_x) * rotated_sx + (by_k - vw * by_ray_y) * rotated_sy
        weight = weight_of(sigma)
        residual[i] = (base + value) * weight
        by_q[i] = (base_by_q + curve_by_q + by_theta * theta_q) * weight
        by_lever[i] = (base_tangent - tangent + by_theta * theta_lever) * weight
        by_psi[i] = (by_k * y * (sin_psi + cos_psi * ray_y) + by_x * cos_psi * ray_x * y) * weight
        by_dx[i] = (sin_tilt * by_k - cos_tilt * by_x) * weight
        by_dy[i] = -(sin_tilt * by_x + cos_tilt * by_k) * weight
        by_tilt[i] = (
            by_x * rotated_y - by_k * rotated_x + by_ray_x * ray_y - by_ray_y * ray_x
        ) * weight


@njit
def is_gentle(p: Floats) -> bool:
    """Test whether the shorter series suffices, even for a point somewhat behind the clamp."""
    behind = 1.3 * p[LEVER] + 0.05
    return bool(p[Q] * behind * behind / 2 < GENTLE_SINE)


@njit
def _points(
    p: Floats,
    points: Floats,
    view: Floats,
    residual: Floats,
    jacobian: Floats,
) -> None:
    n = points.shape[1]
    mx, my, sx, sy = points[X], points[Y], points[SIGMA_X], points[SIGMA_Y]
    out, by_q, by_lever = residual[:n], jacobian[Q, :n], jacobian[LEVER, :n]
    by_psi, by_tilt = jacobian[PSI, :n], jacobian[TILT, :n]
    by_dx, by_dy = jacobian[DX, :n], jacobian[DY, :n]
    if is_gentle(p):
        _rows(
            p, mx, my, sx, sy, view, BEND_GENTLE, GENTLE,
            out, by_q, by_lever, by_psi, by_dx, by_dy, by_tilt,
        )  # fmt: skip
    else:
        _rows(
            p, mx, my, sx, sy, view, BEND_STEEP, STEEP,
            out, by_q, by_lever, by_psi, by_dx, by_dy, by_tilt,
        )  # fmt: skip


@njit
def point_residuals(
    p: Floats,
    points: Floats,
    view: Floats,
    spatial: Any,
    residual: Floats,
    jacobian: Floats,
) -> None:
    """Compute `residual` (n,) and `jacobian` (6, n) of `points` (4, n).

    `view` (3,) is (x, y, w) of the viewpoint, with z = 1. With `spatial`, psi is fitted: then the
    Jacobian is evaluated where each point's ray would be without its error. Un-projection enlarges
    a point's error by a factor that depends on psi; a Jacobian that contains the error would
    correlate with it and bias psi.
    """
    _points(p, points, view, residual, jacobian)
    if not spatial:
        return
    n = points.shape[1]
    shifted, scratch = np.empty((4, n)), np.empty(n)
    for i in range(n):
        shifted[SIGMA_X, i], shifted[SIGMA_Y, i] = points[SIGMA_X, i], points[SIGMA_Y, i]
        shifted[X, i] = points[X, i] - residual[i] * points[SIGMA_X, i]
        shifted[Y, i] = points[Y, i] - residual[i] * points[SIGMA_Y, i]
    _points(p, shifted, view, scratch, jacobian)
