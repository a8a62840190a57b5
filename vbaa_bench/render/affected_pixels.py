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
from vbaa_bench.render.lights import Environment, Lamp, Light

# OpenCV draws with 16-bit integer pixel coordinates.
_FARTHEST_PX = 30_000
# Faces per piece of a mesh; each piece has its own hull.
_FACES = 2000


def pieces(faces: np.ndarray) -> list[np.ndarray]:
    """Return the vertex indices of consecutive runs of faces (n, 3)."""
    return [np.unique(run) for run in np.array_split(faces, math.ceil(len(faces) / _FACES))]


class _Flat(NamedTuple):
    """An image free of distortion that contains the camera's view.

    `low` is the position [px] of its first pixel, `size` its (width, height). `where` holds the row
    and column (height, width) of every camera pixel in it; it is None if the camera has no
    distortion. `stretch` is the largest magnification against the camera's image.
    """

    low: Floats
    size: tuple[int, int]
    where: tuple[np.ndarray, np.ndarray] | None
    stretch: float


@dataclass(frozen=True)
class View:
    """Rasteriser of convex hulls in the image of a camera."""

    camera: Camera

    def hulls(self, bodies: Iterable[Floats], margin: int) -> Mask:
        """Mark every pixel (height, width) within `margin` pixels of the image of a convex body.

        Each body is the hull of points (n, 3) [m] in Sigma_a. A pixel that a body touches only
        partly is marked as well.
        """
        flat = self._flat
        # Drawing is accurate to 1 px: corners and sides of a polygon are rounded. Half a pixel is
        # added to the margin. The look-up in an image free of distortion rounds by 0.5 px more.
        grown = math.floor(flat.stretch * (margin + 0.5) + (1.0 if flat.where is None else 1.5))
        # Polygons just outside the image are dilated into it.
        size = np.add(flat.size, 2 * grown)
        canvas = np.zeros(size[::-1], np.uint8)
        everywhere = np.ones((self.camera.height, self.camera.width), np.bool_)
        ideal = replace(self.camera, distortion=())
        for points in bodies:
            if not self.camera.telecentric and self._depths(points).min() <= 0:
                return everywhere
            pixels = np.rint(ideal.project(points) - flat.low) + grown
            apart = (pixels.max(axis=0) < 0) | (pixels.min(axis=0) >= size)
            if apart.any():
                continue
            if np.abs(pixels).max() > _FARTHEST_PX:
                return everywhere
            cv2.fillConvexPoly(canvas, cv2.convexHull(pixels.astype(np.int32)), 1)
        touched = cv2.dilate(canvas, np.ones((2 * grown + 1, 2 * grown + 1), np.uint8)) > 0
        touched = touched[grown : grown + flat.size[1], grown : grown + flat.size[0]]
        return np.asarray(touched if flat.where is None else touched[flat.where])

    def _depths(self, points: Floats) -> Floats:
        pose = self.camera.camera_from_antenna
        return np.asarray(points @ pose[2, :3] + pose[2, 3])

    @cached_property
    def _flat(self) -> "_Flat":
        """The image free of distortion that contains all camera pixels."""
        camera = self.camera
        if not camera.distortion:
            return _Flat(np.zeros(2), (camera.width, camera.height), None, 1.0)
        rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
        ideal = camera.undistorted_pixels(np.column_stack([columns.ravel(), rows.ravel()]))
        low = np.floor(ideal.min(axis=0))
        place = np.rint(ideal - low).astype(int)
        width, height = place.max(axis=0) + 1
        column, row = place.T.reshape(2, camera.height, camera.width)
        u, v = ideal.T.reshape(2, camera.height, camera.width)
        stretch = max(float(np.abs(np.gradient(axis)).sum(axis=0).max()) for axis in (u, v))
        return _Flat(low, (int(width), int(height)), (row, column), stretch)


def shadows(
    bodies: Iterable[Floats], lights: Iterable[Light], ground: float
) -> list[Floats] | None:
    """Compute hulls of the shadows that bodies cast on the plane z = `ground` [m].

    Bodies are hulls of points (n, 3) in Sigma_a [m]. Return None if a shadow may fall anywhere.
    """
    found = []
    boxes = [_box(points) for points in bodies]
    for light in lights:
        if isinstance(light, Environment):
            return None
        lamp = _box(
            np.asarray(light.mesh.vertices) if isinstance(light, Lamp) else light.position[None]
        )
        for box in boxes:
            if lamp[:, 2].max() <= box[:, 2].min():
                continue  # from below, a shadow falls upward
            if lamp[:, 2].min() <= box[:, 2].max():
                return None
            start, end = lamp[:, None], box[None]
            share = (start[..., 2] - ground) / (start[..., 2] - end[..., 2])
            thrown = (start + share[..., None] * (end - start)).reshape(-1, 3)
            # A body that touches the ground shades the ground under it.
            found.append(np.vstack([thrown, np.column_stack([box[:, :2], np.full(8, ground)])]))
    return found


def _box(points: Floats) -> Floats:
    """Return the eight corners of the bounding box of points (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
