"""Projection of pixels to metric points on the calibration plane C (z = 0 of Sigma_a)."""

from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.compiled import njit
from solver.instrument.distortion import distort
from solver.instrument.errors import InputError


def on_plane(camera: Camera, pixels: Floats, sigmas: Floats) -> tuple[Floats, Floats]:
    """Project `pixels` (n, 2) to points (n, 2) on C [m] and their one-sigma vectors (n, 2) [m].

    `sigmas` (n, 2) [px] are the one-sigma vectors in the image; they are propagated through the
    lens and the projection: d(point)/d(pixel) sigma. Raises InputError at a pixel that the
    distortion model does not reach.
    """
    if not camera.distortion:
        points, vectors = _moved(camera.plane_from_pixels, pixels, sigmas)
        return points, vectors
    normalised = camera.normalised(pixels)
    outside = np.isnan(normalised[:, 0])
    if outside.any():
        u, v = pixels[outside][0]
        raise InputError(
            f"the pixel ({u:.0f}, {v:.0f}) is outside the field of the distortion "
            f"{camera.distortion}: it is not one-to-one so far off the axis"
        )
    _, jacobian = distort(normalised, camera.distortion)
    normalised_sigmas = _undone(jacobian, sigmas / [camera.fx, camera.fy])
    points, vectors = _moved(camera.plane_from_normalised, normalised, normalised_sigmas)
    return points, vectors


@njit
def apply_homography(h: Floats, points: Floats) -> Floats:
    """Map points (n, 2) by a homography (3, 3)."""
    to = np.empty((len(points), 2))
    for i in range(len(points)):
        x, y = points[i]
        w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
        to[i, 0] = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w
        to[i, 1] = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w
    return to


@njit
def _moved(h: Floats, points: Floats, vectors: Floats) -> Any:
    """Map points (n, 2), and small vectors (n, 2) at them, by a homography (3, 3)."""
    to, moved = apply_homography(h, points), np.empty((len(points), 2))
    for i in range(len(points)):
        a, b = vectors[i]
        w = h[2, 0] * points[i, 0] + h[2, 1] * points[i, 1] + h[2, 2]
        shrunk = h[2, 0] * a + h[2, 1] * b
        for k in range(2):
            moved[i, k] = (h[k, 0] * a + h[k, 1] * b - to[i, k] * shrunk) / w
    return to, moved


@njit
def _undone(jacobian: Floats, vectors: Floats) -> Floats:
    """Solve for the vectors (n, 2) that Jacobians (n, 2, 2) map to `vectors`."""
    before = np.empty((len(vectors), 2))
    for i in range(len(vectors)):
        (a, b), (c, d) = jacobian[i]
        x, y = vectors[i]
        determinant = a * d - b * c
        before[i, 0], before[i, 1] = (d * x - b * y) / determinant, (a * y - c * x) / determinant
    return before
