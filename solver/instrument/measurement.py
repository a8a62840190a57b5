"""What a method is given: the beam as measured in one frame, and the rig."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from solver.instrument.arrays import Floats, frozen_floats
from solver.instrument.compiled import njit
from solver.instrument.rig import Rig

UNKNOWN_VIEWPOINT = "plane C alone was calibrated; more views of the board tell the viewpoint"


@dataclass(frozen=True)
class Tip:
    """The image of the beam's free end on plane C (2,) [m], and its covariance (2, 2) [m^2].

    Raises ValueError unless the covariance is positive definite.
    """

    point: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", frozen_floats("tip", self.point, (2,)))
        covariance = frozen_floats("tip covariance", self.covariance, (2, 2))
        _check_positive_definite("tip covariance", covariance)
        object.__setattr__(self, "covariance", covariance)


@dataclass(frozen=True)
class View:
    """The beam in one image, carried onto plane C, in the frame of the beam at rest.

    `points` (n, 2) [m] are where the rays to the beam meet C; `sigma_vectors` (n, 2) [m] are each
    point's one-sigma displacement: a point is measured across the beam and errs along that
    direction only. `viewpoint` (4,) is V in homogeneous coordinates: (x, y, z, 1) [m] of a
    pinhole, (x, y, z, 0), the direction towards it, of a telecentric camera. `tip` is None where
    the free end was not seen. Raises ValueError, also for a viewpoint in plane C, which shows
    nothing of it.
    """

    points: Floats
    sigma_vectors: Floats
    viewpoint: Floats
    tip: Tip | None = None

    def __post_init__(self) -> None:
        points = frozen_floats("points", self.points, (None, 2))
        object.__setattr__(self, "points", points)
        sigmas = frozen_floats("sigma_vectors", self.sigma_vectors, (len(points), 2))
        object.__setattr__(self, "sigma_vectors", sigmas)
        viewpoint = frozen_floats("viewpoint", self.viewpoint, (4,))
        object.__setattr__(self, "viewpoint", viewpoint)
        if viewpoint[2] == 0:
            raise ValueError("the viewpoint lies in the calibration plane")


@dataclass(frozen=True)
class Measurement:
    """The bent beam as measured in one frame, in the frame of the beam at rest.

    That frame has its origin at the clamp, x along the beam at rest, y in plane C towards the side
    to which contact bends the beam, z towards the camera; `antenna_from_beam` (4, 4) carries it
    into Sigma_a (a reflection where the rig deflects towards -y).

    `view` is what the camera saw, `other_views` what further cameras or mirrors showed of the
    same beam. `base_covariance` (3, 3) of (dx, dy, tilt) [m, m, rad] is what is not known of the
    clamp's pose: the clamp stands at (dx, dy) and its tangent is turned by tilt. `scale_sigma` is
    the relative one-sigma error of all lengths. `motor_angle` [rad] is the encoder's reading, None
    where there is none. `moment_y` [N m] about Sigma_a's y axis and `base_force` (3,) [N],
    `base_moment` (3,) [N m] in Sigma_a are sensors' readings, None where there are none; the
    former is what the beam exerts on the sensor, the latter what the clamp exerts on the beam.
    `viewpoint_known` is False where only plane C was calibrated: then nothing that leaves C can be
    estimated. `tip_sigma` is the relative one-sigma error of the length up to the visible tip,
    None where that is the rig's tolerance. `earlier` holds the frames of the same push
    before this one, in order. Raises ValueError.
    """

    view: View
    base_covariance: Floats
    scale_sigma: float
    motor_angle: float | None
    rig: Rig
    antenna_from_beam: Floats = field(default_factory=lambda: np.eye(4))
    moment_y: float | None = None
    base_force: tuple[float, float, float] | None = None
    base_moment: tuple[float, float, float] | None = None
    other_views: tuple[View, ...] = ()
    earlier: tuple["Measurement", ...] = ()
    viewpoint_known: bool = True
    tip_sigma: float | None = None

    def __post_init__(self) -> None:
        base = frozen_floats("base_covariance", self.base_covariance, (3, 3))
        object.__setattr__(self, "base_covariance", base)
        _check_positive_definite("base_covariance", base)
        pose = frozen_floats("antenna_from_beam", self.antenna_from_beam, (4, 4))
        object.__setattr__(self, "antenna_from_beam", pose)
        if not 0 <= self.scale_sigma < math.inf:
            raise ValueError(f"scale_sigma is {self.scale_sigma}, allowed is a number from 0 on")
        for name in ("motor_angle", "moment_y", "base_force", "base_moment"):
            reading = getattr(self, name)
            if reading is not None and not np.isfinite(reading).all():
                raise ValueError(f"{name} holds a value that is not finite")

    @cached_property
    def handedness(self) -> int:
        """+1, or -1 where the frame of the beam is a reflection of Sigma_a.

        Angles about z and x of the beam's frame, psi among them, have the other sign there.
        """
        return 1 if np.linalg.det(self.antenna_from_beam[:3, :3]) > 0 else -1

    @property
    def points(self) -> Floats:
        """The view's points (n, 2) [m]."""
        return self.view.points

    @property
    def sigma_vectors(self) -> Floats:
        """The view's one-sigma vectors (n, 2) [m]."""
        return self.view.sigma_vectors


def _check_positive_definite(name: str, covariance: Floats) -> None:
    if not _positive_definite(covariance):
        raise ValueError(
            f"{name} is not positive definite: what is known exactly needs a small variance"
        )


@njit(cache=True, error_model="numpy")
def _positive_definite(matrix: Floats) -> bool:
    """Whether every pivot of the elimination is positive, as Cholesky's factors need it."""
    left = matrix.copy()
    for k in range(len(left)):
        if not left[k, k] > 0:
            return False
        for i in range(k + 1, len(left)):
            left[i, k + 1 :] -= left[i, k] / left[k, k] * left[k, k + 1 :]
    return True
