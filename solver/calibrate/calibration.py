"""Result of a camera calibration."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError

UNDETERMINED: Final = (
    "the calibration views do not determine the camera: check the board's size in "
    "rig.json, and tilt the board differently in each view but the first"
)


@dataclass(frozen=True)
class Calibration:
    """Calibrated camera, and root mean square reprojection error of the points [px].

    `covariance` (n, n) is that of (focal length, cx, cy [px], the distortion's coefficients,
    rotation (3,) [rad], shift (3,) [m]). The last six are the pose of the board in view 0, which
    defines plane C, about the board's middle and along the camera's axes. It is None for a
    telecentric camera. `viewpoint_known` is False where plane C alone was calibrated.
    """

    camera: Camera
    reprojection_px: float
    covariance: Floats | None = None
    viewpoint_known: bool = True


def determined(values: Floats) -> Floats:
    """Return parameters (n,) of a camera. Raises InputError if one of them is not finite."""
    if not np.isfinite(values).all():
        raise InputError(UNDETERMINED)
    return values
