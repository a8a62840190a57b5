"""Residual terms of a fit, each divided by its sigma."""

import numpy as np

from solver.beam_models import exact
from solver.fitting.gauss_newton import Linearised
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement


def points_on_exact_beam(
    measurement: Measurement, shape: Floats, base: Floats
) -> Linearised | None:
    """Misfit of the measured points, (n,) and its Jacobian (n, 5), in sigmas.

    By `shape` = (q, lever) of the exact beam and `base` = (dx, dy, tilt), the clamp's pose.
    None where the shape does not exist (contact angle of a right angle or more, or bent the
    other way).
    """
    q, lever = shape
    if q < 0 or lever <= 0 or q * lever**2 / 2 >= 0.999:
        return None
    dx, dy, tilt = base
    sine, cosine = np.sin(tilt), np.cos(tilt)
    far_x, far_y = measurement.points[:, 0] - dx, measurement.points[:, 1] - dy
    x, y = cosine * far_x + sine * far_y, cosine * far_y - sine * far_x
    # The curve reaches back to where it has turned by a right angle; no point may lie behind.
    theta_c = np.arcsin(q * lever**2 / 2)
    behind = lever - (x * np.cos(theta_c) + y * np.sin(theta_c))
    if q * max(behind.max(), 0.0) ** 2 / 2 >= 0.999:
        return None
    value, by_point, by_shape = exact.misfit(x, y, q, lever)
    by_base = np.column_stack(
        [
            -by_point[:, 0] * cosine + by_point[:, 1] * sine,
            -by_point[:, 0] * sine - by_point[:, 1] * cosine,
            by_point[:, 0] * y - by_point[:, 1] * x,
        ]
    )
    turned = measurement.sigma_vectors @ np.array([[cosine, -sine], [sine, cosine]])
    sigma = np.abs((by_point * turned).sum(axis=1))
    return value / sigma, np.column_stack([by_shape, by_base]) / sigma[:, None]


def prior(value: Floats, covariance: Floats) -> Linearised:
    """A Gaussian prior N(0, covariance) on `value` (k,): residuals (k,) and Jacobian (k, k)."""
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    return whiten @ value, whiten
