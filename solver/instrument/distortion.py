"""Lens distortion of Brown (1966) and Conrady, with OpenCV's coefficients in OpenCV's order.

(k1, k2, p1, p2, k3) or, with a rational radial part, (k1, k2, p1, p2, k3, k4, k5, k6); none at all
is a lens free of distortion. They act on normalised coordinates, x and y over depth:

    radial = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
    x' = radial x + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = radial y + p1 (r^2 + 2 y^2) + 2 p2 x y
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats

COUNTS: Final = (0, 5, 8)
# Normalised units: a billionth of a pixel.
_EXACT: Final = 1e-12
_MOST_STEPS: Final = 50
_GRID: Final = 65


def distort(points: Floats, coefficients: Sequence[float]) -> tuple[Floats, Floats]:
    """Distorted points (n, 2) of ideal ones (n, 2), both normalised, and their Jacobian (n, 2, 2).

    The Jacobian is symmetric, d(distorted)/d(ideal).
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = (*coefficients, *(0.0,) * (8 - len(coefficients)))
    x, y = points.T
    r2 = x * x + y * y
    above, below = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = above / below
    # d(radial)/d(r^2), twice.
    slope = k1 + r2 * (2 * k2 + 3 * r2 * k3) - radial * (k4 + r2 * (2 * k5 + 3 * r2 * k6))
    slope *= 2 / below
    distorted = np.column_stack(
        [
            radial * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            radial * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ]
    )
    jacobian = np.empty((len(points), 2, 2))
    jacobian[:, 0, 0] = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    jacobian[:, 1, 1] = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    jacobian[:, 0, 1] = jacobian[:, 1, 0] = slope * x * y + 2 * p1 * x + 2 * p2 * y
    return distorted, jacobian


def undistort(points: Floats, coefficients: Sequence[float]) -> Floats:
    """Ideal points (n, 2) of distorted ones (n, 2), both normalised, by Newton's method.

    Raises ValueError where no ideal point is found, or one on a side folded over: there the
    distortion is not one-to-one.
    """
    ideal = points.astype(np.float64)  # a copy
    if not coefficients:
        return ideal
    with np.errstate(all="ignore"):  # what runs away is refused below
        for _ in range(_MOST_STEPS):
            distorted, jacobian = distort(ideal, coefficients)
            left = points - distorted
            ideal += _solved(jacobian, left)
            if (
                np.abs(left).max(initial=0.0) < _EXACT
                and _determinants(jacobian).min(initial=1) > 0
            ):
                return ideal
    raise ValueError(f"the distortion {tuple(coefficients)} is not one-to-one where it is undone")


def one_to_one(points: Floats, coefficients: Sequence[float]) -> bool:
    """Whether no two ideal points are shown at one place, between the axis and distorted points.

    The distorted points (n, 2) are the rim of a field about the axis. The Jacobian's determinant
    must be positive on a grid of rays from the axis to them.
    """
    try:
        rim = undistort(points, coefficients)
    except ValueError:
        return False
    shares = np.linspace(0, 1, _GRID)[:, None, None]
    _, jacobian = distort((shares * rim).reshape(-1, 2), coefficients)
    return bool((_determinants(jacobian) > 0).all())


def _determinants(jacobian: Floats) -> Floats:
    return np.asarray(jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] ** 2)


def _solved(jacobian: Floats, vectors: Floats) -> Floats:
    """Solutions (n, 2) of n pairs of equations with symmetric matrices (n, 2, 2)."""
    a, b, d = jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 1, 1]
    x, y = vectors.T
    return np.column_stack([d * x - b * y, a * y - b * x]) / _determinants(jacobian)[:, None]
