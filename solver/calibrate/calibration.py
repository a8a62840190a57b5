"""Result of a camera calibration."""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from solver.calibrate.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError

UNDETERMINED: Final = (
    "the calibration views do not determine the camera: check the board's size in "
    "rig.json, and tilt the board differently in each view but the first"
)


class Stretch(NamedTuple):
    """Height over width of a board's squares, less 1, and its sigma."""

    value: float
    sigma: float

    @property
    def is_significant(self) -> bool:
        """Whether the board is not square, beyond noise and the errors of a good printer."""
        return abs(self.value) > max(
            THRESHOLDS.max_stretch, THRESHOLDS.max_stretch_sigmas * self.sigma
        )

    @property
    def sentence(self) -> str:
        """Describe the stretch, and what to do."""
        return (
            f"the board's squares are {100 * abs(self.value):.2f} +- {100 * self.sigma:.2g} % "
            f"{'taller' if self.value > 0 else 'less tall'} than wide, so that focal length and "
            "heights are wrong: measure both sides of the print, and print it without scaling (or "
            "the camera's pixels are not square)"
        )


@dataclass(frozen=True)
class Calibration:
    """Calibrated camera, and root mean square reprojection error of the points [px].

    `covariance` (n, n) is that of (focal length, cx, cy [px], the distortion's coefficients,
    rotation (3,) [rad], shift (3,) [m]). The last six are the pose of the board in view 0, which
    defines plane C, about the board's middle and along the camera's axes. It is None for a
    telecentric camera. `viewpoint_known` is False where plane C alone was calibrated. `stretch` is
    that of the printed board, None where one view does not show it.
    """

    camera: Camera
    reprojection_px: float
    covariance: Floats | None = None
    viewpoint_known: bool = True
    stretch: Stretch | None = None


def determined(values: Floats) -> Floats:
    """Return parameters (n,) of a camera. Raises InputError if one of them is not finite."""
    if not np.isfinite(values).all():
        raise InputError(UNDETERMINED)
    return values
