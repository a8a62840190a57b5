"""Convert a measurement to the arrays of the compiled fit."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement, Tip
from solver.instrument.small_matrices import whitening
from solver.uniform.constraints import TIP_COLUMNS
from solver.uniform.residuals import (
    DX,
    DY,
    KNOWN,
    LEVER,
    MOMENT,
    MOMENT_SIGMA,
    MOMENT_UNIT,
    PSI,
    RIGIDITY,
    RIGIDITY_SIGMA,
    STRETCH,
    STRETCH_SIGMA,
    TILT,
    FrameArrays,
    Q,
)

# Minimum relative sigma of a length and of a rigidity.
_MIN_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Problem:
    """Input of the compiled fit: `arrays`, in units of the beam's length.

    `order` (n,) is, for each point of `arrays`, its index among the measurement's points;
    `shared_errors` (n, k) are those of `View`, in this order; `shape_free` and `all_free`
    are the free parameters with psi held and with psi free. The
    motor's axis passes through the clamp.
    """

    arrays: FrameArrays
    order: Any
    shape_free: Any
    all_free: Any
    tilt_variance: float
    shared_errors: Floats

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self.order)


def problem_of(measurement: Measurement, with_tip: bool = True) -> Problem:
    """Convert a measurement to arrays, optionally without a visible tip.

    Raises ValueError if a viewpoint is in plane C.
    """
    rig, length = measurement.rig, measurement.rig.beam.length
    view = measurement.view
    order, rows = np.argsort(view.points[:, 0], kind="stable"), np.empty((4, len(view.points)))
    # Mode "clip" writes to `out` without a buffer.
    np.take(view.points.T, order, axis=1, out=rows[:2], mode="clip")
    np.take(view.sigma_vectors.T, order, axis=1, out=rows[2:], mode="clip")
    known = np.zeros(KNOWN)
    tips = [] if view.tip is None or not with_tip else [_tip_row(view.tip, length)]
    shape_free = [Q, LEVER, DX, DY, TILT]
    if tips:
        shape_free.append(STRETCH)
        stretch_sigma = measurement.tip_sigma
        if stretch_sigma is None:
            tolerance = rig.tolerances.beam_length / length
            stretch_sigma = math.hypot(tolerance, measurement.scale_sigma)
        known[STRETCH_SIGMA] = max(stretch_sigma, _MIN_TOLERANCE)
    if measurement.moment_y is not None and rig.sensors.moment_y is not None:
        shape_free.append(RIGIDITY)
        rotation = measurement.antenna_from_beam[:3, :3]
        rigidity = rig.beam.flexural_rigidity
        # A moment is a pseudovector: the reflection of a beam that bends to -y reverses it.
        known[MOMENT_UNIT] = rigidity / length * measurement.handedness * rotation[1, 1]
        known[MOMENT], known[MOMENT_SIGMA] = measurement.moment_y, rig.sensors.moment_y
        known[RIGIDITY_SIGMA] = max(
            math.hypot(
                rig.tolerances.flexural_rigidity / rigidity,
                rig.shape.rigidity_sigma,
                measurement.scale_sigma,
            ),
            _MIN_TOLERANCE,
        )
    arrays = FrameArrays(
        points=rows / length,
        viewpoint=view_row(view.viewpoint, length),
        tips=np.array(tips).reshape(-1, TIP_COLUMNS),
        known=known,
        base_whitening=base_whitening(measurement.base_covariance, length),
    )
    return Problem(
        arrays=arrays,
        order=order,
        shape_free=np.array(sorted(shape_free)),
        all_free=np.array(sorted([*shape_free, PSI])),
        tilt_variance=float(measurement.base_covariance[2, 2]),
        shared_errors=view.shared_errors[order],
    )


def without(problem: Problem, kept: Any) -> Problem:
    """Return the problem with only the `kept` (n,) of the measurement's points."""
    mask = kept[problem.order]
    points = np.ascontiguousarray(problem.arrays.points[:, mask])
    return replace(
        problem,
        arrays=problem.arrays._replace(points=points),
        order=np.arange(int(mask.sum())),
        shared_errors=problem.shared_errors[mask],
    )


def view_row(viewpoint: Floats, length: float) -> Floats:
    """Convert a homogeneous viewpoint (4,) [m] to (x, y, w), z = 1, lengths in units of `length`.

    Raises ValueError if it is in plane C.
    """
    x, y, z, w = viewpoint
    if z == 0:
        raise ValueError("the viewpoint is in the calibration plane")
    return np.array([x / z, y / z, w / z * length])


def base_whitening(covariance: Floats, length: float) -> Floats:
    """Compute the matrix (3, 3) that whitens the clamp's error, lengths in units of `length`."""
    unit = np.array([1 / length, 1 / length, 1.0])
    return np.asarray(whitening(covariance * unit * unit[:, None]))


def _tip_row(tip: Tip, length: float) -> Floats:
    whitener = whitening(tip.covariance / length**2)
    return np.array([*(tip.point / length), *whitener.ravel(), tip.rim / length])
