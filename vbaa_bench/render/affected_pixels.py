"""Pixels that moving surfaces can affect: where they may be visible, and where they cast shadows.

Both are upper bounds from convex hulls: a pixel outside is identical to that of the still scene.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera
from vbaa_bench.scene.lights.emitter import Emitter

# OpenCV draws with 16-bit integer pixel coordinates.
_MAX_COORDINATE_PX = 30_000
# Faces per piece of a mesh; each piece has its own hull.
_PIECE_FACES = 2000


def pieces(faces: np.ndarray) -> list[np.ndarray]:
    """Return the vertex indices of consecutive runs of faces (n, 3)."""
    return [np.unique(run) for run in np.array_split(faces, math.ceil(len(faces) / _PIECE_FACES))]


class _UndistortedImage(NamedTuple):
    """An image free of distortion that contains the camera's view.

    `low` is the position [px] of its first pixel, `size` its (width, height). `lookup` holds the
    row and column (height, width) of every camera pixel in it; it is None if the camera has no
    distortion. `scale` is the largest magnification relative to the camera's image.
    """

    low: Floats
    size: tuple[int, int]
    lookup: tuple[np.ndarray, np.ndarray] | None
    scale: float


@dataclass(frozen=True)
class View:
    """Rasteriser of convex hulls in the image of a camera."""

    camera: Camera

    def hulls(self, bodies: Iterable[Floats], margin: int) -> Mask:
        """Mark every pixel (height, width) within `margin` pixels of the image of a convex body.

        Each body is the hull of points (n, 3) [m] in Sigma_a. A pixel that a body touches only
        partly is marked as well.
        """
        image = self._undistorted
        # Drawing is accurate to 1 px: corners and sides of a polygon are rounded. Half a pixel is
        # added to the margin. The look-up in an image free of distortion rounds by 0.5 px more.
        radius = math.floor(image.scale * (margin + 0.5) + (1.0 if image.lookup is None else 1.5))
        # Polygons just outside the image are dilated into it.
        size = np.add(image.size, 2 * radius)
        canvas = np.zeros(size[::-1], np.uint8)
        all_pixels = np.ones((self.camera.height, self.camera.width), np.bool_)
        ideal = replace(self.camera, distortion=())
        for points in bodies:
            if not self.camera.telecentric and self._depths(points).min() <= 0:
                return all_pixels
            pixels = np.rint(ideal.project(points) - image.low) + radius
            outside = (pixels.max(axis=0) < 0) | (pixels.min(axis=0) >= size)
            if outside.any():
                continue
            if not np.abs(pixels).max() <= _MAX_COORDINATE_PX:  # nor NaN
                return all_pixels
            cv2.fillConvexPoly(canvas, cv2.convexHull(pixels.astype(np.int32)), 1)
        covered = cv2.dilate(canvas, np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)) > 0
        covered = covered[radius : radius + image.size[1], radius : radius + image.size[0]]
        return np.asarray(covered if image.lookup is None else covered[image.lookup])

    def _depths(self, points: Floats) -> Floats:
        pose = self.camera.camera_from_antenna
        return np.asarray(points @ pose[2, :3] + pose[2, 3])

    @cached_property
    def _undistorted(self) -> "_UndistortedImage":
        """The image free of distortion that contains all camera pixels."""
        camera = self.camera
        if not camera.distortion:
            return _UndistortedImage(np.zeros(2), (camera.width, camera.height), None, 1.0)
        rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
        ideal = camera.undistorted_pixels(np.column_stack([columns.ravel(), rows.ravel()]))
        low = np.floor(ideal.min(axis=0))
        indices = np.rint(ideal - low).astype(int)
        width, height = indices.max(axis=0) + 1
        column, row = indices.T.reshape(2, camera.height, camera.width)
        u, v = ideal.T.reshape(2, camera.height, camera.width)
        scale = max(float(np.abs(np.gradient(axis)).sum(axis=0).max()) for axis in (u, v))
        return _UndistortedImage(low, (int(width), int(height)), (row, column), scale)


def shadows(
    bodies: Iterable[Floats], lights: Iterable[Emitter], ground: float
) -> list[Floats] | None:
    """Compute hulls of the shadows that bodies cast on the plane z = `ground` [m].

    Bodies are hulls of points (n, 3) in Sigma_a [m]. Return None if a shadow may fall anywhere.
    """
    hulls = []
    boxes = [_box(points) for points in bodies]
    for light in lights:
        extent = light.extent()
        if extent is None:
            return None
        lamp = _box(extent)
        for box in boxes:
            if lamp[:, 2].max() <= box[:, 2].min():
                continue  # from below, a shadow falls upward
            if lamp[:, 2].min() <= box[:, 2].max():
                return None
            start, end = lamp[:, None], box[None]
            fraction = (start[..., 2] - ground) / (start[..., 2] - end[..., 2])
            shadow = (start + fraction[..., None] * (end - start)).reshape(-1, 3)
            # A body that touches the ground shades the ground under it.
            hulls.append(np.vstack([shadow, np.column_stack([box[:, :2], np.full(8, ground)])]))
    return hulls


def _box(points: Floats) -> Floats:
    """Return the eight corners of the bounding box of points (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
