"""Estimated contact points with their ellipses, in space."""

from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.scoring.camera_frame import camera_frame_from_clamp
from vbaa_bench.viewer.ellipse_plot import ellipse
from vbaa_bench.viewer.frames import ViewedFrame


class EstimatedContact(NamedTuple):
    """Contact point (3,) and its 95 % ellipse (n, 3) in plane D, in the camera's frame [m].

    The ellipse is None if a sigma or the correlation of x_c and y_c is not stated.
    """

    point: Floats
    ellipse: Floats | None


def estimated_contact(frame: ViewedFrame, method: str) -> EstimatedContact | None:
    """Place a method's contact point in the frame in which the camera is fixed.

    Return None if x_c or y_c is not estimated. A method that does not estimate psi assumes 0.
    """
    row = frame.estimates.get(method)
    if row is None or row["x_c_mm"] is None or row["y_c_mm"] is None:
        return None
    psi = (row["psi_deg"] or 0.0) * DEGREE
    in_plane = np.array([row["x_c_mm"], row["y_c_mm"]])
    transform = camera_frame_from_clamp(frame.truth, frame.row["true_motor_angle_deg"] * DEGREE)

    def in_space(points: Floats) -> Floats:
        x, y = points.T * MILLIMETRE
        return np.asarray(apply(transform, np.column_stack([x, y * np.cos(psi), y * np.sin(psi)])))

    (point,) = in_space(in_plane[None])
    sigmas, correlation = (row["x_c_sigma_mm"], row["y_c_sigma_mm"]), row["x_c_y_c_correlation"]
    if None in sigmas or correlation is None or abs(correlation) > 1:
        return EstimatedContact(point, None)
    return EstimatedContact(point, in_space(in_plane + ellipse(sigmas, correlation)))
