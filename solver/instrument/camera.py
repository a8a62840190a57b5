"""The pinhole camera. The pixel rule of the whole project is said here, once:

a pixel's centre has integer coordinates (OpenCV's rule), so the image of W columns spans
u from -1/2 to W - 1/2, and the middle of the image is ((W - 1) / 2, (H - 1) / 2).
"""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats, frozen_floats
from solver.instrument.transforms import apply


@dataclass(frozen=True)
class Camera:
    """Intrinsics [px] and pose of a pinhole camera.

    `camera_from_antenna` (4, 4) carries Sigma_a [m] into OpenCV's camera axes (x right,
    y down, z forward).
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_from_antenna: Floats

    def __post_init__(self) -> None:
        pose = frozen_floats("camera_from_antenna", self.camera_from_antenna, (4, 4))
        object.__setattr__(self, "camera_from_antenna", pose)

    @property
    def matrix(self) -> Floats:
        """OpenCV's camera matrix (3, 3) [px]."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    def project(self, points: Floats) -> Floats:
        """Pixels (n, 2), as (u, v), of points (n, 3) in Sigma_a [m]; all in front of the camera."""
        x, y, z = apply(self.camera_from_antenna, points).T
        return np.column_stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy])
