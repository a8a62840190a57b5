"""Lens distortion of Brown (1966) and Conrady, with OpenCV's coefficients in OpenCV's order.

(k1, k2, p1, p2, k3) or, with a rational radial part, (k1, k2, p1, p2, k3, k4, k5, k6); without
coefficients there is no distortion. They apply to normalised coordinates, x and y over depth:

    radial = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
    x' = radial x + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = radial y + p1 (r^2 + 2 y^2) + 2 p2 x y
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final

import numpy as np

from solver.instrument.arrays import Bools, Floats
from solver.instrument.compiled import njit

COUNTS: Final = (0, 5, 8)
# Convergence threshold in normalised units: a billionth of a pixel.
_EXACT: Final = 1e-12
# Newton's method converges quadratically from about the fifth step; halved steps near a fold take
# some more.
_MOST_STEPS: Final = 60
# Largest step, as a fraction of the distance to the rim of the one-to-one field: the Jacobian is
# singular on the rim, and Newton's method cannot continue from there.
_TO_THE_RIM: Final = 0.95
# Chosen: 84 degrees off the axis, outside the view of any pinhole camera. Rings 0.005 apart are
# 5 px at a focal length of 1000 px; a narrower fold would be missed. Only the tangential part
# depends on direction.
_MAX_RADIUS: Final = 10.0
_RINGS: Final = 2001
_BISECTIONS: Final = 40
_ANGLES: Final = np.linspace(0, 2 * np.pi, 32, endpoint=False)
_DIRECTIONS: Final = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])


def distort(points: Floats, coefficients: Sequence[float]) -> tuple[Floats, Floats]:
    """Distort ideal points (n, 2), normalised; return the result and its Jacobian (n, 2, 2).

    The Jacobian d(distorted)/d(ideal) is symmetric.
    """
    distorted, jacobian = _distorted(_contiguous(points), _padded(coefficients))
    return distorted, jacobian


def undistort(points: Floats, coefficients: Sequence[float]) -> Floats:
    """Compute the ideal points (n, 2) of distorted points (n, 2), both normalised.

    Newton's method is restricted to the disc about the axis in which the distortion is one-to-one:
    farther out the image is folded, and two ideal points have the same distorted point. Return NaN
    if the disc contains no solution.
    """
    if not coefficients:
        return points.astype(np.float64)  # a copy
    radius, distorted_radius = _one_to_one_field(tuple(coefficients))
    ideal: Floats = _undistorted(
        _contiguous(points), _padded(coefficients), radius, distorted_radius
    )
    return ideal


def one_to_one(points: Floats, coefficients: Sequence[float]) -> bool:
    """Return whether the distortion can be undone at all of these distorted points (n, 2)."""
    return bool(np.isfinite(undistort(points, coefficients)).all())


@lru_cache(maxsize=64)
def _one_to_one_field(coefficients: tuple[float, ...]) -> tuple[float, float]:
    """Find the radius of the one-to-one field, and the largest radius of its distorted image.

    The distortion is the gradient of a potential. If its Jacobian is positive definite on a disc,
    the potential is convex there, and no two points have the same gradient.
    """
    radii = np.linspace(0.0, _MAX_RADIUS, _RINGS)
    positive = _positive(radii, coefficients)
    low = _MAX_RADIUS
    if not positive.all():
        first = int(np.argmin(positive))
        low, high = radii[max(first - 1, 0)], radii[first]
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            inside = _positive(np.array([middle]), coefficients)[0]
            low, high = (middle, high) if inside else (low, middle)
    rim, _ = distort(low * _DIRECTIONS, coefficients)
    return float(low), float(np.hypot(*rim.T).max())


def _positive(radii: Floats, coefficients: tuple[float, ...]) -> Bools:
    """Return whether the Jacobian is positive definite on circles of radii (n,) about the axis."""
    _, jacobian = distort((radii[:, None, None] * _DIRECTIONS).reshape(-1, 2), coefficients)
    trace = jacobian[:, 0, 0] + jacobian[:, 1, 1]
    with np.errstate(all="ignore"):  # infinite at a pole of the rational part
        determinant = jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] ** 2
    positive = (trace > 0) & (determinant > 0)
    return np.asarray(positive.reshape(len(radii), -1).all(axis=1))


# A contiguous copy: the functions below are compiled for one array layout only.
def _contiguous(points: Floats) -> Floats:
    return np.array(points, dtype=np.float64, order="C").reshape(-1, 2)


def _padded(coefficients: Sequence[float]) -> Floats:
    return np.array([*coefficients, *(0.0,) * (8 - len(coefficients))], dtype=np.float64)


@njit
def _one(x: float, y: float, lens: Floats) -> tuple[float, float, float, float, float]:
    """Distort a point; return x', y', dx'/dx, dx'/dy = dy'/dx and dy'/dy."""
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    r2 = x * x + y * y
    above, below = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = above / below
    # d(radial)/d(r^2), twice.
    slope = k1 + r2 * (2 * k2 + 3 * r2 * k3) - radial * (k4 + r2 * (2 * k5 + 3 * r2 * k6))
    slope *= 2 / below
    return (
        radial * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        radial * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        radial + slope * x * x + 2 * p1 * y + 6 * p2 * x,
        slope * x * y + 2 * p1 * x + 2 * p2 * y,
        radial + slope * y * y + 6 * p1 * y + 2 * p2 * x,
    )


@njit
def _distorted(points: Floats, lens: Floats) -> Any:
    distorted, jacobian = np.empty((len(points), 2)), np.empty((len(points), 2, 2))
    for i in range(len(points)):
        u, v, a, b, d = _one(points[i, 0], points[i, 1], lens)
        distorted[i, 0], distorted[i, 1] = u, v
        jacobian[i, 0, 0], jacobian[i, 1, 1] = a, d
        jacobian[i, 0, 1] = jacobian[i, 1, 0] = b
    return distorted, jacobian


@njit
def _undistorted(points: Floats, lens: Floats, radius: float, shown: float) -> Floats:
    """Undistort points in a field of this `radius`, whose distorted image has radius `shown`.

    A step that does not reduce the residual is halved: on a convex function, a Newton step that is
    short enough always reduces it.
    """
    ideal = np.full((len(points), 2), np.nan)
    for i in range(len(points)):
        u, v = points[i]
        if not np.hypot(u, v) <= shown:
            continue
        shrink = min(1.0, 0.9 * radius / max(np.hypot(u, v), 1e-300))
        x, y, share = shrink * u, shrink * v, 1.0
        at_u, at_v, a, b, d = _one(x, y, lens)
        off = max(abs(u - at_u), abs(v - at_v))
        for _ in range(_MOST_STEPS):
            determinant = a * d - b * b
            dx = share * (d * (u - at_u) - b * (v - at_v)) / determinant
            dy = share * (a * (v - at_v) - b * (u - at_u)) / determinant
            if off <= _EXACT * max(1.0, abs(u), abs(v)):
                ideal[i, 0], ideal[i, 1] = x + dx, y + dy  # the last step is exact to rounding
                break
            here, there = np.hypot(x, y), np.hypot(x + dx, y + dy)
            limit = here + _TO_THE_RIM * (radius - here)
            if there > limit:
                dx, dy = dx + (x + dx) * (limit / there - 1), dy + (y + dy) * (limit / there - 1)
            next_u, next_v, next_a, next_b, next_d = _one(x + dx, y + dy, lens)
            nearer = max(abs(u - next_u), abs(v - next_v))
            if nearer < off:
                x, y, off, share = x + dx, y + dy, nearer, min(2 * share, 1.0)
                at_u, at_v, a, b, d = next_u, next_v, next_a, next_b, next_d
            else:
                share /= 2
    return ideal
