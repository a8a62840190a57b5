"""Input of a method: the beam as measured in one frame, and the rig."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from solver.instrument.arrays import Floats, freeze
from solver.instrument.compiled import njit
from solver.instrument.rig import Rig
from solver.instrument.small_matrices import cholesky, whitening

UNKNOWN_VIEWPOINT = "only plane C was calibrated; the viewpoint needs more board views"


@dataclass(frozen=True)
class Tip:
    """Image of the beam's free end on plane C (2,) [m], and its covariance (2, 2) [m^2].

    It is the place of the axis for an end in a plane parallel to C. What is seen is the end's rim,
    `rim` [m] above the axis: an end that points towards the camera looks shorter by as much, times
    the sine of its slope to C. Raises ValueError unless the covariance is positive definite.
    """

    point: Floats
    covariance: Floats
    rim: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, "point", (2,), "tip")
        covariance = freeze(self, "covariance", (2, 2), "tip covariance")
        _check_positive_definite("tip covariance", covariance)


@dataclass(frozen=True)
class RestBow:
    """The bow of the beam at rest, which was removed from the points of a view.

    `coefficients` (3,) [m] are those of x^2, x^3, x^4, x over the beam's length, in the frame of
    the beam at rest; `by_weight` (3,) [m] are their change since then by the beam's own weight.
    `covariance` (5, 5) is that of the line at rest with them: its y at the clamp
    [m] and slope, coefficients [m]; of the former two the measurement's `base_covariance` contains
    `line_covariance` (2, 2), for the straight line through the whole curve. `removed` (n, 2) [m]
    was subtracted from the points: a bow moves each point along its normal, to first order.
    `scale_sigma` is the relative error of lengths that this leaves. The first `errors` columns of
    the view's shared errors are those of the bow. Raises ValueError if array shapes are wrong or a
    value is not finite.
    """

    coefficients: Floats
    covariance: Floats
    line_covariance: Floats
    removed: Floats
    scale_sigma: float
    errors: int
    by_weight: Floats = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        freeze(self, "coefficients", (3,))
        freeze(self, "by_weight", (3,))
        freeze(self, "covariance", (5, 5))
        freeze(self, "line_covariance", (2, 2))
        freeze(self, "removed", (None, 2))


@dataclass(frozen=True)
class View:
    """Beam in one image, projected onto plane C, in the frame of the beam at rest.

    `points` (n, 2) [m] are the intersections of the rays to the beam with C. `sigma_vectors` (n, 2)
    [m] are the one-sigma displacement of each point: a point is measured across the beam, and its
    error is along that direction only. `shared_errors` (n, k) are k independent errors that all
    points share: the shift of each point for one sigma, in units of its sigma vector; they are in
    addition to the points' own errors. `lost_light` (n,) is that of `Centreline`. `viewpoint` (4,)
    is V in homogeneous coordinates: (x, y, z, 1) [m] for a pinhole; (x, y, z, 0), the direction
    towards the camera, for a telecentric camera. `tip` is None if the free end is not visible.
    Raises ValueError, also for a viewpoint in plane C, from which C cannot be observed.
    """

    points: Floats
    sigma_vectors: Floats
    viewpoint: Floats
    tip: Tip | None = None
    shared_errors: Floats = field(default_factory=lambda: np.empty((0, 0)))
    lost_light: Floats = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        count = len(freeze(self, "points", (None, 2)))
        freeze(self, "sigma_vectors", (count, 2))
        if not np.size(self.shared_errors):
            object.__setattr__(self, "shared_errors", np.empty((count, 0)))
        freeze(self, "shared_errors", (count, None))
        if not np.size(self.lost_light):
            object.__setattr__(self, "lost_light", np.zeros(count))
        freeze(self, "lost_light", (count,))
        viewpoint = freeze(self, "viewpoint", (4,))
        if viewpoint[2] == 0:
            raise ValueError("the viewpoint is in the calibration plane")


@dataclass(frozen=True)
class Measurement:
    """Bent beam as measured in one frame, in the frame of the beam at rest.

    That frame has its origin at the clamp, x along the beam at rest, y in plane C towards the side
    to which contact bends the beam, z towards the camera; `antenna_from_beam` (4, 4) maps it
    to Sigma_a (it is a reflection if the rig deflects towards -y).

    `view` is the view of the camera. `base_covariance` (3, 3) of (dx, dy, tilt) [m, m, rad] is the
    uncertainty of the clamp's image: the clamp is at (dx, dy) and its tangent is rotated by tilt.
    It includes the `image_shift` (2, 2) [m^2], the covariance of shifts of the image since rest,
    which do not move the clamp. `scale_sigma` is the relative one-sigma error of all lengths.
    `motor_angle` [rad] is the encoder's reading. `moment_y` [N m] about Sigma_a's y axis,
    `base_force` (3,) [N] and `base_moment` (3,) [N m] in Sigma_a are sensor readings; the first is
    exerted by the beam on the sensor, the other two by the clamp on the beam. Readings that do not
    exist are None. `viewpoint_known` is False if only plane C was calibrated: then only quantities
    within C can be estimated. `tip_sigma` is the relative one-sigma error of the length up to the
    visible tip, None if it is the rig's tolerance. `earlier` contains the previous frames of the
    same push, in order. `rest_bow` is None for a beam without a bow. `axis_sigma` [m] is that of
    the beam's axis about its apparent middle at rest, across the beam. `errors_are_fitted` is True
    if shared errors are to be estimated, as those of a user are. Raises ValueError.
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
    earlier: tuple["Measurement", ...] = ()
    viewpoint_known: bool = True
    tip_sigma: float | None = None
    rest_bow: RestBow | None = None
    image_shift: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    axis_sigma: float = 0.0
    errors_are_fitted: bool = False

    def __post_init__(self) -> None:
        _check_positive_definite("base_covariance", freeze(self, "base_covariance", (3, 3)))
        freeze(self, "image_shift", (2, 2))
        freeze(self, "antenna_from_beam", (4, 4))
        if not 0 <= self.scale_sigma < math.inf:
            raise ValueError(f"scale_sigma is {self.scale_sigma}, allowed is a finite number >= 0")
        readings = {
            "motor_angle": (self.motor_angle,),
            "moment_y": (self.moment_y,),
            "base_force": self.base_force or (),
            "base_moment": self.base_moment or (),
        }
        for name, values in readings.items():
            if not all(value is None or math.isfinite(value) for value in values):
                raise ValueError(f"{name} holds a value that is not finite")

    @cached_property
    def handedness(self) -> int:
        """Handedness of the beam's frame: +1, or -1 if it is a reflection of Sigma_a.

        If it is -1, angles about z and x of the beam's frame, such as psi, have the opposite sign.
        """
        # The triple product of the rows: NumPy's determinant takes 1 % of the time of a fit.
        (a, b, c), (d, e, f), (g, h, i) = self.antenna_from_beam[:3, :3].tolist()
        return 1 if a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g) > 0 else -1

    @property
    def uniform(self) -> bool:
        """Whether the closed form of a straight uniform beam describes this one well enough.

        A bow is removed to first order; what this leaves must not be the largest error of lengths.
        """
        bow = self.rest_bow
        straight = bow is None or 2 * bow.scale_sigma**2 <= self.scale_sigma**2
        return self.rig.shape.uniform and straight and not self.errors_are_fitted

    @property
    def points(self) -> Floats:
        """Points (n, 2) [m] of the view."""
        return self.view.points

    @property
    def sigma_vectors(self) -> Floats:
        """One-sigma vectors (n, 2) [m] of the view."""
        return self.view.sigma_vectors

    def with_shared_errors(self, shifts_of: Callable[["Measurement"], Floats]) -> "Measurement":
        """Return the measurement with k more errors that all points share, and earlier frames too.

        `shifts_of` returns the displacements (k, n, 2) [m] of a measurement's points for one sigma
        of each, which are the same errors in all frames; a point is measured along its sigma
        vector only. Clamp and tip stay. Fits estimate the errors, which those of the calibration
        are not. Raises ValueError if the shape is wrong.
        """
        shifts, sigmas = np.asarray(shifts_of(self), np.float64), self.sigma_vectors
        if shifts.ndim != 3 or shifts.shape[1:] != sigmas.shape:
            raise ValueError(f"shifts has shape {shifts.shape}, allowed is (k, {len(sigmas)}, 2)")
        columns = (shifts * sigmas).sum(axis=2) / (sigmas**2).sum(axis=1)
        shared = np.column_stack([self.view.shared_errors, columns.T])
        return replace(
            self,
            view=replace(self.view, shared_errors=shared),
            earlier=tuple(frame.with_shared_errors(shifts_of) for frame in self.earlier),
            errors_are_fitted=True,
        )

    @cached_property
    def shift_by_clamp(self) -> Floats:
        """Jacobian (2, 3) of the image's shift, as the clamp's pose shows it, by (dx, dy, tilt)."""
        # The copy is writable: for the frozen array `whitening` would be compiled once more.
        whitener = whitening(self.base_covariance.copy())
        return np.asarray(self.image_shift @ (whitener.T @ whitener)[:2])

    @cached_property
    def total_sigma_vectors(self) -> Floats:
        """One-sigma vectors (n, 2) [m] of each point's own and shared errors together."""
        shared = (self.view.shared_errors**2).sum(axis=1)
        return np.asarray(self.sigma_vectors * np.sqrt(1 + shared)[:, None])


def _check_positive_definite(name: str, covariance: Floats) -> None:
    if not _positive_definite(covariance):
        raise ValueError(f"{name} is not positive definite: give exact quantities a small variance")


@njit
def _positive_definite(matrix: Floats) -> bool:
    return cholesky(matrix.copy())
