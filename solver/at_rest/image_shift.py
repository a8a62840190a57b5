"""Shift of an image since the rest images, from what the rig states and what the landmarks show."""

from typing import NamedTuple

import numpy as np

from solver.at_rest.landmarks import Shift
from solver.at_rest.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats


class ImageShift(NamedTuple):
    """The most likely shift (du, dv) [px] of an image, and its covariance (2, 2) [px^2]."""

    shift: Floats
    covariance: Floats


def image_shift(measured: Shift | None, sigma_px: float) -> ImageShift:
    """Combine a measured shift with the prior, which has the sigma `sigma_px` in each direction.

    Shadows and reflections move the landmarks a little, too. Where nothing was measured, the prior
    remains.
    """
    prior = np.eye(2) * sigma_px**2
    if measured is None:
        return ImageShift(np.zeros(2), prior)
    du, dv, uu, uv, vv = measured
    error = np.array([[uu, uv], [uv, vv]]) + np.eye(2) * THRESHOLDS.steadiness_px**2
    gain = prior @ np.linalg.inv(prior + error)
    covariance = prior - gain @ prior
    return ImageShift(gain @ [du, dv], (covariance + covariance.T) / 2)
