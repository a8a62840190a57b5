"""Pixels -> metric points on the calibration plane C (z = 0 of Sigma_a)."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera


def homography(camera: Camera) -> Floats:
    """plane_from_normalised (3, 3): homogeneous ideal coordinates to homogeneous (x, y) on C [m].

    Affine for a telecentric camera: its homogeneous coordinate is 1 where a pinhole's is depth.
    """
    x, y, depth, one = camera.camera_from_antenna
    rows = np.stack([x, y, one if camera.telecentric else depth])
    return np.asarray(np.linalg.inv(rows[:, [0, 1, 3]]), dtype=np.float64)


def on_plane(camera: Camera, pixels: Floats, sigmas: Floats) -> tuple[Floats, Floats]:
    """Points (n, 2) on C [m] seen at `pixels` (n, 2), and their one-sigma vectors (n, 2) [m].

    `sigmas` (n, 2) [px] are the one-sigma vectors in the image; they are carried through the lens
    and the projection: d(point)/d(pixel) sigma. Raises ValueError where the lens's distortion is
    not one-to-one.
    """
    h, normalised = homography(camera), camera.normalised(pixels)
    x, y, w = h @ np.column_stack([normalised, np.ones(len(pixels))]).T
    points = np.column_stack([x / w, y / w])
    # d(normalised), then d(point), along the error.
    along = (np.linalg.inv(camera.pixel_slopes(normalised)) @ sigmas[:, :, None])[:, :, 0]
    moved = (along @ h[:2, :2].T - points * (along @ h[2, :2])[:, None]) / w[:, None]
    return points, moved
