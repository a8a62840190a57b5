"""What a method is given: the beam's visible points on the calibration plane, and the rig."""

from dataclasses import dataclass

from solver.instrument.arrays import Floats, frozen_floats
from solver.instrument.rig import Rig


@dataclass(frozen=True)
class Measurement:
    """The bent beam as measured in one frame, in the frame of the beam at rest.

    `points` (n, 2) [m] are (x, y) on plane C, origin at the clamp, x along the beam at rest,
    y towards the side it bends to. `sigma_vectors` (n, 2) [m] are each point's one-sigma
    displacement: a point measured in one image column errs along that column only.
    `base_covariance` (3, 3) of (dx, dy, tilt) [m, m, rad] is what is not known of the clamp's
    pose; `scale_sigma` the relative one-sigma error of all lengths. `motor_angle` [rad] is the
    encoder's reading. Raises ValueError.
    """

    points: Floats
    sigma_vectors: Floats
    base_covariance: Floats
    scale_sigma: float
    motor_angle: float
    rig: Rig

    def __post_init__(self) -> None:
        points = frozen_floats("points", self.points, (None, 2))
        sigmas = frozen_floats("sigma_vectors", self.sigma_vectors, (len(points), 2))
        base = frozen_floats("base_covariance", self.base_covariance, (3, 3))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "sigma_vectors", sigmas)
        object.__setattr__(self, "base_covariance", base)
