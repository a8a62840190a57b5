"""Fit many frames in compiled code: from points to (q, lever) with covariance."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.fitting.frame_fit import CHI2, KEPT, STATUS, WIDENING, fit_robust
from solver.fitting.minimise import CONVERGED, DEFICIENT
from solver.fitting.problem import base_whitening, view_row
from solver.fitting.residuals import (
    DX,
    DY,
    KNOWN,
    LEVER,
    PARAMETERS,
    SIGMA_X,
    SIGMA_Y,
    TILT,
    Q,
    X,
    Y,
)
from solver.fitting.starts import initial_estimate, workspace
from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from solver.instrument.compiled import njit
from solver.instrument.dot_products import FAST


@dataclass(frozen=True)
class Batch:
    """Fits of m frames.

    `parameters` (m, 5) are q [1/m^2], lever [m] of the exact beam and dx [m], dy [m], tilt [rad]
    of the clamp, `covariances` (m, 5, 5) their covariances. `chi2` (m,) is the misfit of the
    points that were not rejected as outliers, `kept` (m,) their number. `converged` (m,) is True
    where the fit converged; elsewhere parameters and covariances are zero.
    """

    parameters: Floats
    covariances: Floats
    chi2: Floats
    kept: Any
    converged: Any


def exact_fit_batch(
    points: Floats,
    sigma_vectors: Floats,
    offsets: Any,
    base_covariance: Floats,
    beam: Beam,
    *,
    viewpoint: Floats | None = None,
    psi: float = 0.0,
) -> Batch:
    """Fit the exact beam to each of m frames by least squares, as `exact_fit` does to one.

    `points` and `sigma_vectors` (n, 2) [m] contain all frames one after another, frame i from
    `offsets[i]` to `offsets[i + 1]`, in the frame of the beam at rest; `base_covariance` (3, 3)
    [m, m, rad] is that of the clamp's pose. `viewpoint` (4,) is used only if `psi` [rad] is not
    zero. Raises ValueError if array shapes are inconsistent or a value is not finite.
    """
    points, sigma_vectors = (
        np.ascontiguousarray(values, dtype=np.float64) for values in (points, sigma_vectors)
    )
    offsets = np.asarray(offsets, dtype=np.int64)
    if points.shape != sigma_vectors.shape or points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(
            f"points have shape {points.shape}, sigma vectors {sigma_vectors.shape}, "
            "allowed is (n, 2) for both"
        )
    ascending = len(offsets) > 0 and bool((offsets[1:] >= offsets[:-1]).all())
    if not ascending or offsets[0] < 0 or offsets[-1] > len(points):
        raise ValueError("offsets do not ascend within the points")
    length = beam.length
    centre = np.array([0.0, 0.0, 1.0, 0.0]) if viewpoint is None else np.asarray(viewpoint)
    views = view_row(centre, length)[None]
    unit = np.array([length**-2, length, length, length, 1.0])
    whitening = base_whitening(base_covariance, length)
    base_tilt = float(np.asarray(base_covariance)[2, 2])
    parameters, covariances, summary = _fit_all(
        points, sigma_vectors, length, offsets, views, whitening, base_tilt, psi
    )
    if np.isnan(summary[:, CHI2]).any():
        raise ValueError("a point or a sigma is not finite")
    return Batch(
        parameters * unit,
        covariances * np.outer(unit, unit),
        summary[:, CHI2],
        summary[:, KEPT].astype(np.int64),
        summary[:, STATUS] == CONVERGED,
    )


@njit(fastmath=FAST)
def _split_columns(vectors: Floats, unit: float, x: Floats, y: Floats) -> float:
    """Write vectors (n, 2) over `unit` to x and y; return their sum, finite if all values are."""
    total, scale = 0.0, 1 / unit
    for i in range(len(vectors)):
        along, across = vectors[i, 0] * scale, vectors[i, 1] * scale
        x[i], y[i] = along, across
        total += along + across
    return total


@njit
def _fit_all(
    points: Floats,
    sigma_vectors: Floats,
    length: float,
    offsets: Any,
    views: Floats,
    whitening: Floats,
    tilt_variance: float,
    psi: float,
) -> Any:
    frames = len(offsets) - 1
    parameters, covariances = np.zeros((frames, 5)), np.zeros((frames, 5, 5))
    summary = np.zeros((frames, 5))
    free = np.array([Q, LEVER, DX, DY, TILT])
    tips, known = np.zeros((0, 7)), np.zeros(KNOWN)
    p, covariance = np.zeros(PARAMETERS), np.zeros((PARAMETERS, PARAMETERS))
    max_points = 0
    for i in range(frames):
        max_points = max(max_points, offsets[i + 1] - offsets[i])
    inliers = np.ones(max_points, dtype=np.bool_)
    work = workspace(max_points)
    rows, bounds = np.empty((4, max_points)), np.zeros(2, dtype=np.int64)
    problem = (rows, bounds, views, tips, known, whitening)
    for i in range(frames):
        n = offsets[i + 1] - offsets[i]
        bounds[1] = n
        frame = slice(offsets[i], offsets[i + 1])
        total = _split_columns(points[frame], length, rows[X], rows[Y])
        total += _split_columns(sigma_vectors[frame], length, rows[SIGMA_X], rows[SIGMA_Y])
        summary[i, STATUS] = DEFICIENT
        if not np.isfinite(total):
            summary[i, CHI2] = np.nan
            continue
        if n == 0 or not initial_estimate(problem, free, tilt_variance, psi, p):
            continue
        fit_robust(p, problem, free, tilt_variance, work, covariance, inliers[:n], summary[i])
        if summary[i, STATUS] == CONVERGED:
            inflation = summary[i, WIDENING]
            for a in range(5):
                parameters[i, a] = p[free[a]]
                for b in range(5):
                    covariances[i, a, b] = inflation * covariance[free[a], free[b]]
    return parameters, covariances, summary
