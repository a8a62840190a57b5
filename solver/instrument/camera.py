"""The camera, pinhole or telecentric. The pixel rule of the whole project is said here, once:

a pixel's centre has integer coordinates (OpenCV's rule), so the image of W columns spans
u from -1/2 to W - 1/2, and the middle of the image is ((W - 1) / 2, (H - 1) / 2).
"""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, frozen_floats
from solver.instrument.transforms import apply


@dataclass(frozen=True)
class Camera:
    """Intrinsics and pose of a camera.

    `camera_from_antenna` (4, 4) carries Sigma_a [m] into OpenCV's camera axes (x right,
    y down, z forward). A pinhole divides by depth, and fx, fy are [px]. A telecentric camera,
    as on a microscope, sees along parallel rays: depth does not move a point in its image, and
    fx, fy are the magnification [px/m]. cx, cy [px] are where the optical axis meets the image.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_from_antenna: Floats
    telecentric: bool = False

    def __post_init__(self) -> None:
        pose = frozen_floats("camera_from_antenna", self.camera_from_antenna, (4, 4))
        object.__setattr__(self, "camera_from_antenna", pose)

    @property
    def matrix(self) -> Floats:
        """OpenCV's camera matrix (3, 3): [px], for a telecentric camera fx and fy [px/m]."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    def project(self, points: Floats) -> Floats:
        """Pixels (n, 2), as (u, v), of points (n, 3) in Sigma_a [m]; all in front of the camera."""
        x, y, z = apply(self.camera_from_antenna, points).T
        divisor = self._divisor(z)
        return np.column_stack([self.fx * x / divisor + self.cx, self.fy * y / divisor + self.cy])

    def pixels_per_metre(self, points: Floats) -> Floats:
        """Magnification (n,) [px/m] of lengths across the optical axis at points (n, 3) [m]."""
        return self.fx / self._divisor(apply(self.camera_from_antenna, points)[:, 2])

    def _divisor(self, depth: Floats) -> Floats:
        return np.ones_like(depth) if self.telecentric else depth
