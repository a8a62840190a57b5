"""The camera, pinhole or telecentric. The pixel rule of the whole project is said here, once:

a pixel's centre has integer coordinates (OpenCV's rule), so the image of W columns spans
u from -1/2 to W - 1/2, and the middle of the image is ((W - 1) / 2, (H - 1) / 2).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.instrument.arrays import Floats, Mask, frozen_floats
from solver.instrument.distortion import COUNTS, distort, undistort
from solver.instrument.transforms import apply, invert

# A point that is folded back into the image lies far off the one that belongs there; rounding,
# magnified near the fold, is less than this in normalised units: a thousandth of a pixel.
_SAME = 1e-6


@dataclass(frozen=True)
class Camera:
    """Intrinsics and pose of a camera.

    `camera_from_antenna` (4, 4) carries Sigma_a [m] into OpenCV's camera axes (x right,
    y down, z forward). A pinhole divides by depth, and fx, fy are [px]. A telecentric camera,
    as on a microscope, sees along parallel rays: depth does not move a point in its image, and
    fx, fy are the magnification [px/m]. cx, cy [px] are where the optical axis meets the image.
    `distortion` holds no, five or eight coefficients, as `distortion.py` says; a telecentric
    camera has none. Raises ValueError where pose or distortion are not of this kind.
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
        pose = frozen_floats("camera_from_antenna", self.camera_from_antenna, (4, 4))
        object.__setattr__(self, "camera_from_antenna", pose)
        coefficients = tuple(float(value) for value in self.distortion)
        object.__setattr__(self, "distortion", coefficients)
        if len(coefficients) not in COUNTS or not all(map(math.isfinite, coefficients)):
            raise ValueError(f"distortion is {coefficients}, allowed are 0, 5 or 8 finite numbers")
        if self.telecentric and coefficients:
            raise ValueError("distortion is modelled for a pinhole, not for a telecentric camera")

    @property
    def matrix(self) -> Floats:
        """OpenCV's camera matrix (3, 3): [px], for a telecentric camera fx and fy [px/m]."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @cached_property
    def viewpoint(self) -> Floats:
        """V in Sigma_a, homogeneous (4,): (x, y, z, 1) [m] of a pinhole, (x, y, z, 0) far away."""
        antenna_from_camera = invert(self.camera_from_antenna)
        if self.telecentric:
            return np.append(-antenna_from_camera[:3, 2], 0.0)
        return np.append(antenna_from_camera[:3, 3], 1.0)

    @cached_property
    def normalised_from_plane(self) -> Floats:
        """The homography (3, 3) from places on C, z = 0 of Sigma_a [m], to ideal coordinates.

        Affine for a telecentric camera: its homogeneous coordinate is 1 where a pinhole's is depth.
        """
        rows = self.camera_from_antenna[[0, 1, 3 if self.telecentric else 2]]
        return np.ascontiguousarray(rows[:, [0, 1, 3]])

    @cached_property
    def plane_from_normalised(self) -> Floats:
        """The inverse (3, 3) of `normalised_from_plane`."""
        return np.asarray(np.linalg.inv(self.normalised_from_plane), dtype=np.float64)

    @cached_property
    def plane_from_pixels(self) -> Floats:
        """The homography (3, 3) from pixels of a lens free of distortion to places on C [m]."""
        return np.asarray(self.plane_from_normalised @ np.linalg.inv(self.matrix))

    def project(self, points: Floats) -> Floats:
        """Pixels (n, 2), as (u, v), of points (n, 3) in Sigma_a [m]; all in front of the camera.

        A distorted point is where the lens shows it only within the field over which the
        distortion is one-to-one; from farther off it may be folded back into the image.
        """
        x, y, z = apply(self.camera_from_antenna, points).T
        seen = np.column_stack([x, y]) / self._divisor(z)[:, None]
        if self.distortion:
            seen, _ = distort(seen, self.distortion)
        return self._pixels(seen)

    def shows(self, points: Floats) -> Mask:
        """Tell which points (n, 3) in Sigma_a [m] it shows, in the image or beside it.

        They are before the camera, and so near to its axis that the distortion is one-to-one:
        farther out, `project` folds a point back towards the axis.
        """
        x, y, z = apply(self.camera_from_antenna, points).T
        shown = np.ones(len(points), np.bool_) if self.telecentric else z > 0
        if self.distortion:
            ideal = np.column_stack([x, y])[shown] / z[shown, None]
            back = undistort(distort(ideal, self.distortion)[0], self.distortion)
            shown[shown] = np.abs(back - ideal).max(axis=1) < _SAME
        return shown

    def normalised(self, pixels: Floats) -> Floats:
        """Ideal coordinates (n, 2) of pixels (n, 2), as (u, v): x and y over depth, undistorted.

        Exact to 1e-12. Of a telecentric camera, x and y themselves [m]. NaN where the lens shows
        nothing, so far off the axis that its distortion is not one-to-one.
        """
        distorted = (pixels - [self.cx, self.cy]) / [self.fx, self.fy]
        return undistort(distorted, self.distortion)

    def undistorted_pixels(self, pixels: Floats) -> Floats:
        """Where a lens free of distortion would show what is seen at pixels (n, 2); or NaN."""
        return self._pixels(self.normalised(pixels))

    def pixels_per_metre(self, points: Floats) -> Floats:
        """Magnification (n,) [px/m] of lengths across the optical axis at points (n, 3) [m].

        The lens's distortion is left out.
        """
        return self.fx / self._divisor(apply(self.camera_from_antenna, points)[:, 2])

    def _pixels(self, normalised: Floats) -> Floats:
        return np.asarray(normalised * [self.fx, self.fy] + [self.cx, self.cy])

    def _divisor(self, depth: Floats) -> Floats:
        return np.ones_like(depth) if self.telecentric else depth
