"""Convert a measurement to the arrays of the compiled fit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from solver.fitting.constraints import TIP_COLUMNS
from solver.fitting.residuals import (
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
    Q,
)
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement, View
from solver.instrument.small_matrices import whitening

# Minimum relative sigma of a length and of a rigidity.
_MIN_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Problem:
    """Input of the compiled fit: `arrays` as in `frame_fit`, in units of the beam's length.

    `order` (n,) is, for each point of `arrays`, its index among the measurement's points of all
    views; `shared_errors` (n, k) are those of `View`, in this order; `shape_free` and `all_free`
    are the free parameters with psi held and with psi free. The
    motor's axis passes through the clamp.
    """

    arrays: Any
    order: Any
    shape_free: Any
    all_free: Any
    tilt_variance: float
    shared_errors: Floats

    @property
    def points(self) -> int:
        """Number of points in all views."""
        return len(self.order)


def problem_of(measurement: Measurement, with_tips: bool = True) -> Problem:
    """Convert a measurement to arrays, optionally without the tips visible in its views.

    Raises ValueError if a viewpoint is in plane C.
    """
    rig, length = measurement.rig, measurement.rig.beam.length
    views = (measurement.view, *measurement.other_views)
    bounds = np.array([0, *accumulate(len(view.points) for view in views)])
    order, rows = np.empty(bounds[-1], np.int64), np.empty((4, bounds[-1]))
    for view, (first, last) in zip(views, pairwise(bounds), strict=True):
        ranks = np.argsort(view.points[:, 0], kind="stable")
        order[first:last] = first + ranks
        # Mode "clip" writes to `out` without a buffer.
        np.take(view.points.T, ranks, axis=1, out=rows[:2, first:last], mode="clip")
        np.take(view.sigma_vectors.T, ranks, axis=1, out=rows[2:, first:last], mode="clip")
    known = np.zeros(KNOWN)
    tip_views = [(i, view) for i, view in enumerate(views) if with_tips and view.tip is not None]
    tips = [_tip_row(view, i, length) for i, view in tip_views]
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
    arrays = (
        rows / length,
        bounds,
        np.array([view_row(view.viewpoint, length) for view in views]),
        np.array(tips).reshape(-1, TIP_COLUMNS),
        known,
        base_whitening(measurement.base_covariance, length),
    )
    return Problem(
        arrays=arrays,
        order=order,
        shape_free=np.array(sorted(shape_free)),
        all_free=np.array(sorted([*shape_free, PSI])),
        tilt_variance=float(measurement.base_covariance[2, 2]),
        shared_errors=_shared_errors(views)[order],
    )


def _shared_errors(views: Sequence[View]) -> Floats:
    """Stack the errors that the points of each view share; those of two views are independent."""
    shared = [view.shared_errors for view in views]
    return shared[0] if len(shared) == 1 else np.asarray(block_diag(*shared))


def without(problem: Problem, kept: Any) -> Problem:
    """Return the problem with only the `kept` (n,) of the measurement's points."""
    rows, bounds, *rest = problem.arrays
    mask = kept[problem.order]
    counts = [int(mask[a:b].sum()) for a, b in pairwise(bounds)]
    new_bounds = np.array([0, *accumulate(counts)])
    arrays = (np.ascontiguousarray(rows[:, mask]), new_bounds, *rest)
    return replace(
        problem,
        arrays=arrays,
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


def _tip_row(view: View, index: int, length: float) -> Floats:
    tip = view.tip
    assert tip is not None
    whitener = whitening(tip.covariance / length**2)
    return np.array([*(tip.point / length), *whitener.ravel(), index])
