"""Which pixels what moves can change: where it may be seen, and where it may cast a shadow.

Both are told from above, by convex hulls: a pixel outside shows exactly what the still scene does.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera
from vbaa_bench.render.lights import Environment, Lamp, Light

# OpenCV draws in 16 bits of whole pixels.
_FARTHEST_PX = 30_000
# A mesh is cut into pieces of so many faces, each with its own hull.
_FACES = 2000


def pieces(faces: np.ndarray) -> list[np.ndarray]:
    """The vertices of consecutive runs of faces (n, 3)."""
    return [np.unique(run) for run in np.array_split(faces, math.ceil(len(faces) / _FACES))]


@dataclass(frozen=True)
class View:
    """Fills hulls in the image of a camera."""

    camera: Camera

    def hulls(self, bodies: Iterable[Floats], margin: int) -> Mask:
        """Where any of some convex bodies shows, and `margin` pixels farther: each body is the hull
        of points (n, 3) in Sigma_a [m]."""
        low, size, where = self._canvas
        canvas = np.zeros(size[::-1], np.uint8)
        everywhere = np.ones((self.camera.height, self.camera.width), np.bool_)
        ideal = replace(self.camera, distortion=())
        for points in bodies:
            if not self.camera.telecentric and self._depths(points).min() <= 0:
                return everywhere
            pixels = np.rint(ideal.project(points) - low)
            apart = (pixels.max(axis=0) < -margin) | (pixels.min(axis=0) >= np.add(size, margin))
            if apart.any():
                continue
            if np.abs(pixels).max() > _FARTHEST_PX:
                return everywhere
            cv2.fillConvexPoly(canvas, cv2.convexHull(pixels.astype(np.int32)), 1)
        shown = canvas if where is None else canvas[where[1], where[0]]
        reach = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
        return np.asarray(cv2.dilate(shown, reach) > 0)

    def _depths(self, points: Floats) -> Floats:
        pose = self.camera.camera_from_antenna
        return np.asarray(points @ pose[2, :3] + pose[2, 3])

    @cached_property
    def _canvas(self) -> tuple[Floats, tuple[int, int], tuple[np.ndarray, np.ndarray] | None]:
        """Corner and size of an image free of distortion, and where in it every pixel lies."""
        camera = self.camera
        if not camera.distortion:
            return np.zeros(2), (camera.width, camera.height), None
        rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
        ideal = camera.undistorted_pixels(np.column_stack([columns.ravel(), rows.ravel()]))
        low = np.floor(ideal.min(axis=0))
        place = np.rint(ideal - low).astype(int)
        width, height = place.max(axis=0) + 1
        x, y = place.T.reshape(2, camera.height, camera.width)
        return low, (int(width), int(height)), (x, y)


def shadows(
    bodies: Iterable[Floats], lights: Iterable[Light], ground: float
) -> list[Floats] | None:
    """Hulls of the shadows that bodies cast on the plane z = `ground` [m]; None: they may be
    anywhere. Bodies are hulls of points (n, 3) in Sigma_a [m]."""
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
            # What stands on the ground shades the ground under it.
            found.append(np.vstack([thrown, np.column_stack([box[:, :2], np.full(8, ground)])]))
    return found


def _box(points: Floats) -> Floats:
    """The eight corners of the box about points (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
