"""Pinhole view of plane C from a free pose, with a radial distortion, and its derivatives.

Pixels are relative to the principal point, the middle of the image. A point m (2,) of plane C, in
units of the beam's length, has the ideal image

    e = (w + s A m) / (1 + (s / f) g.m),

where w [px] is that of the clamp, s [px per length] the scale there, f [px] the focal length, and A
(2, 2) and g (2,) are the rows of the rotation from Sigma_a to the camera's axes (right, down,
forward). The image is e (1 + k1 |e|^2 / f^2). The rotation is

    R = Rz(roll) Rx(a) Ry(b) diag(1, -1, -1),

so that without roll and without the view's angles a and b the camera looks along the plane's
normal, with x of Sigma_a to the right and y up.
"""

from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.distortion import undistort

# Parameters of a view: image of the clamp [px], roll, log of the scale, angles a and b; and those
# that all views share: log of the focal length [px], and k1.
U, V, ROLL, SCALE, VIEW_A, VIEW_B, FOCAL, K1 = range(8)
PARAMETERS: Final = 8
_FACING: Final = np.diag([1.0, -1.0, -1.0])
# Generators of rotations about the camera's axes.
_ABOUT_X: Final = np.array([[0.0, 0, 0], [0, 0, -1], [0, 1, 0]])
_ABOUT_Y: Final = np.array([[0.0, 0, 1], [0, 0, 0], [-1, 0, 0]])
_ABOUT_Z: Final = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])


class Images(NamedTuple):
    """Images (n, 2) [px] of n points, with their gradients.

    `by_place` (n, 2, 2) is that by the points, `by_view` (n, 2, 8) that by the parameters.
    """

    pixels: Floats
    by_place: Floats
    by_view: Floats


class Places(NamedTuple):
    """Points (n, 2) of plane C whose images are n pixels, with their gradients.

    `by_pixel` (n, 2, 2) is that by the pixels, `by_view` (n, 2, 8) that by the parameters.
    """

    points: Floats
    by_pixel: Floats
    by_view: Floats


def rotation_of(view: Floats) -> tuple[Floats, Floats]:
    """Return the first two columns (3, 2) of R of a view (8,), and their gradients (3, 3, 2).

    The gradients are in the order roll, a, b.
    """
    about_z = _rotation(_ABOUT_Z, view[ROLL])
    about_x, about_y = _rotation(_ABOUT_X, view[VIEW_A]), _rotation(_ABOUT_Y, view[VIEW_B])
    base = _FACING[:, :2]
    gradients = np.array(
        [
            _ABOUT_Z @ about_z @ about_x @ about_y @ base,
            about_z @ _ABOUT_X @ about_x @ about_y @ base,
            about_z @ about_x @ _ABOUT_Y @ about_y @ base,
        ]
    )
    return about_z @ about_x @ about_y @ base, gradients


def _rotation(generator: Floats, angle: float) -> Floats:
    """Return the rotation (3, 3) by Rodrigues' formula."""
    turn = np.sin(angle) * generator + (1 - np.cos(angle)) * generator @ generator
    return np.asarray(np.eye(3) + turn)


def images_of(points: Floats, view: Floats) -> Images | None:
    """Project points (n, 2) of plane C; None if one is not in front of the camera."""
    scale, focal, k1 = np.exp(view[SCALE]), np.exp(view[FOCAL]), view[K1]
    columns, by_angles = rotation_of(view)
    across, depth = scale * points @ columns[:2].T, scale / focal * points @ columns[2]
    divisor = 1 + depth
    if not (divisor > 0).all():
        return None
    ideal = (view[[U, V]] + across) / divisor[:, None]
    n = len(points)
    by_view = np.zeros((n, 2, PARAMETERS))
    by_view[:, 0, U] = by_view[:, 1, V] = 1 / divisor
    by_view[:, :, SCALE] = (across - ideal * depth[:, None]) / divisor[:, None]
    by_view[:, :, FOCAL] = ideal * (depth / divisor)[:, None]
    for parameter, turned in zip((ROLL, VIEW_A, VIEW_B), by_angles, strict=True):
        moved = scale * points @ turned[:2].T
        farther = scale / focal * points @ turned[2]
        by_view[:, :, parameter] = (moved - ideal * farther[:, None]) / divisor[:, None]
    matrix = scale * columns[:2] - scale / focal * ideal[:, :, None] * columns[2]
    by_place = matrix / divisor[:, None, None]
    radius2 = (ideal**2).sum(axis=1) / focal**2
    by_ideal = (1 + k1 * radius2)[:, None, None] * np.eye(2)
    by_ideal = by_ideal + 2 * k1 / focal**2 * ideal[:, :, None] * ideal[:, None, :]
    by_view = by_ideal @ by_view
    by_view[:, :, FOCAL] -= 2 * (k1 * radius2)[:, None] * ideal
    by_view[:, :, K1] = radius2[:, None] * ideal
    pixels = ideal * (1 + k1 * radius2)[:, None]
    return Images(pixels, by_ideal @ by_place, by_view)


def places_of(pixels: Floats, view: Floats) -> Places | None:
    """Find the points of plane C whose images are pixels (n, 2).

    Return None if a pixel's ray does not meet the plane, or if the distortion is not one-to-one.
    """
    scale, focal = np.exp(view[SCALE]), np.exp(view[FOCAL])
    ideal = focal * undistort(pixels / focal, (view[K1], 0.0, 0.0, 0.0, 0.0))
    if not np.isfinite(ideal).all():
        return None
    columns, _ = rotation_of(view)
    matrix = scale * columns[:2] - scale / focal * ideal[:, :, None] * columns[2]
    # The plane is seen from its front.
    if not (np.linalg.det(matrix) < 0).all():
        return None
    points = np.linalg.solve(matrix, (ideal - view[[U, V]])[:, :, None])[:, :, 0]
    images = images_of(points, view)
    if images is None:
        return None
    by_pixel = np.asarray(np.linalg.inv(images.by_place), dtype=np.float64)
    return Places(np.asarray(points, dtype=np.float64), by_pixel, -by_pixel @ images.by_view)
