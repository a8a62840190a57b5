"""Camera model, pinhole or telecentric.

Pixel convention of the whole project: a pixel's centre has integer coordinates (OpenCV's
convention), so an image of W columns spans u from -1/2 to W - 1/2, and the centre of the image is
((W - 1) / 2, (H - 1) / 2).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.instrument.arrays import Floats, Mask, freeze
from solver.instrument.distortion import COUNTS, distort, undistort
from solver.instrument.transforms import apply, invert

# Largest difference, in normalised units, between an ideal point and its round trip: a
# thousandth of a pixel. Rounding errors, magnified near the fold, are smaller; a point folded back
# into the image differs by far more.
_ROUND_TRIP_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Camera:
    """Intrinsics and pose of a camera.

    `camera_from_antenna` (4, 4) maps Sigma_a [m] to OpenCV's camera axes (x right, y down,
    z forward). A pinhole projection divides by depth, and fx, fy are in [px]. A telecentric camera,
    as on a microscope, projects along parallel rays: the image of a point does not depend on its
    depth, and fx, fy are the magnification [px/m]. cx, cy [px] are the principal point.
    `distortion` holds no, five or eight coefficients in the order given in `distortion.py`; a
    telecentric camera has none. Raises ValueError if pose or distortion have another form.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_from_antenna: Floats
    telecentric: bool = False
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "camera_from_antenna", (4, 4))
        coefficients = tuple(float(value) for value in self.distortion)
        object.__setattr__(self, "distortion", coefficients)
        if len(coefficients) not in COUNTS or not all(map(math.isfinite, coefficients)):
            raise ValueError(f"distortion is {coefficients}, allowed are 0, 5 or 8 finite numbers")
        if self.telecentric and coefficients:
            raise ValueError("distortion is modelled for a pinhole, not for a telecentric camera")

    @property
    def matrix(self) -> Floats:
        """OpenCV's camera matrix (3, 3) in [px]; for a telecentric camera fx and fy in [px/m]."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @cached_property
    def viewpoint(self) -> Floats:
        """V in Sigma_a, homogeneous (4,): pinhole (x, y, z, 1) [m], telecentric (x, y, z, 0)."""
        antenna_from_camera = invert(self.camera_from_antenna)
        if self.telecentric:
            return np.append(-antenna_from_camera[:3, 2], 0.0)
        return np.append(antenna_from_camera[:3, 3], 1.0)

    @cached_property
    def normalised_from_plane(self) -> Floats:
        """Homography (3, 3) from points on C, z = 0 of Sigma_a [m], to ideal coordinates.

        It is affine for a telecentric camera: the homogeneous coordinate is 1 instead of the depth.
        """
        rows = self.camera_from_antenna[[0, 1, 3 if self.telecentric else 2]]
        return np.ascontiguousarray(rows[:, [0, 1, 3]])

    @cached_property
    def plane_from_normalised(self) -> Floats:
        """Inverse (3, 3) of `normalised_from_plane`."""
        return np.asarray(np.linalg.inv(self.normalised_from_plane), dtype=np.float64)

    @cached_property
    def plane_from_pixels(self) -> Floats:
        """Homography (3, 3) from undistorted pixels to points on C [m]."""
        return np.asarray(self.plane_from_normalised @ np.linalg.inv(self.matrix))

    def project(self, points: Floats) -> Floats:
        """Project points (n, 3) in Sigma_a [m] to pixels (n, 2), as (u, v).

        All points must be in front of the camera. With distortion, a pixel is valid only within the
        field in which the distortion is one-to-one; a point outside it may be folded back into the
        image.
        """
        x, y, z = apply(self.camera_from_antenna, points).T
        image_points = np.column_stack([x, y]) / self._divisor(z)[:, None]
        if self.distortion:
            image_points, _ = distort(image_points, self.distortion)
        return self._pixels(image_points)

    def shows(self, points: Floats) -> Mask:
        """Return a mask (n,) of the points (n, 3) in Sigma_a [m] that `project` maps correctly.

        They are in front of the camera and so near to its axis that the distortion is one-to-one;
        farther out, `project` folds a point back towards the axis. They may be outside the image.
        """
        x, y, z = apply(self.camera_from_antenna, points).T
        valid = np.ones(len(points), np.bool_) if self.telecentric else z > 0
        if self.distortion:
            ideal = np.column_stack([x, y])[valid] / z[valid, None]
            undistorted = undistort(distort(ideal, self.distortion)[0], self.distortion)
            valid[valid] = np.abs(undistorted - ideal).max(axis=1) < _ROUND_TRIP_TOLERANCE
        return valid

    def contains(self, pixels: Floats) -> Mask:
        """Return a mask (n,) of the places (n, 2), (u, v), that are in the image."""
        largest = [self.width - 0.5, self.height - 0.5]
        return np.asarray(((pixels > -0.5) & (pixels < largest)).all(axis=1))

    def directions_from(self, points: Floats) -> Floats:
        """Compute unit vectors (n, 3) in Sigma_a from points (n, 3) [m] to the camera."""
        if self.telecentric:
            return np.tile(self.viewpoint[:3], (len(points), 1))
        towards = self.viewpoint[:3] - points
        return np.asarray(towards / np.linalg.norm(towards, axis=1, keepdims=True))

    def on_plane(self, pixels: Floats) -> Floats:
        """Project pixels (n, 2), (u, v), to points (n, 3) of plane C [m]."""
        ideal = np.column_stack([self.normalised(pixels), np.ones(len(pixels))])
        x, y, w = self.plane_from_normalised @ ideal.T
        return np.column_stack([x / w, y / w, np.zeros(len(pixels))])

    def normalised(self, pixels: Floats) -> Floats:
        """Convert pixels (n, 2), (u, v), to ideal coordinates (n, 2): x and y over depth.

        The distortion is undone, exact to 1e-12. For a telecentric camera, return x and y
        themselves [m]. Return NaN outside the field in which the distortion is one-to-one.
        """
        distorted = (pixels - [self.cx, self.cy]) / [self.fx, self.fy]
        return undistort(distorted, self.distortion)

    def undistorted_pixels(self, pixels: Floats) -> Floats:
        """Undistort pixels (n, 2); return NaN outside the one-to-one field of the distortion."""
        return self._pixels(self.normalised(pixels))

    def pixels_per_metre(self, points: Floats) -> Floats:
        """Compute the magnification (n,) [px/m] across the optical axis at points (n, 3) [m].

        Lens distortion is neglected.
        """
        return self.fx / self._divisor(apply(self.camera_from_antenna, points)[:, 2])

    def _pixels(self, normalised: Floats) -> Floats:
        return np.asarray(normalised * [self.fx, self.fy] + [self.cx, self.cy])

    def _divisor(self, depth: Floats) -> Floats:
        return np.ones_like(depth) if self.telecentric else depth
