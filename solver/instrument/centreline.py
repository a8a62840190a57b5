"""The beam's centreline in an image: measured points with sigmas, and rejected points."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, freeze
from solver.instrument.grid_error import GridError

# Largest difference of a direction's length from 1. Chosen: it changes no sigma by more.
_UNIT = 1e-6


class Flag(IntEnum):
    """Reason why no point was measured at an expected position of the beam."""

    HIDDEN = 1
    SATURATED = 2
    FOREIGN = 3


@dataclass(frozen=True)
class Centreline:
    """Points (n, 2) [px], as (u, v), each measured along its unit vector in `directions` (n, 2).

    The error of a point is along its direction only: along the image column in which it was
    measured, or along the row where the beam is steep. `sigma` (n,) [px] is its standard deviation,
    which is positive.
    `rejected` (m, 2) [px] are expected positions of the beam without a measured point, `flags` (m,)
    the reasons. `tip` (2,) [px] is the image of the beam's free end, `tip_covariance` (2, 2) [px^2]
    its covariance; both are None if the tip is not visible. `common_sigma` [px] is the standard
    deviation of the error, along the directions, that all points share. `shift` (2,) [px] is that
    of the whole image since the rest images, with the covariance `shift_covariance` (2, 2) [px^2];
    the points contain it. `remark` describes how the image differs from the rest images; it is ""
    if it does not differ. `lost_light` (n,) is the share of the beam's light that each point lacks,
    which an object beside it hides; it is 0 where that is not known. `grid_error` has been
    subtracted from the points; None if there is none.
    """

    points: Floats
    directions: Floats
    sigma: Floats
    rejected: Floats = field(default_factory=lambda: np.empty((0, 2)))
    flags: npt.NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, np.uint8))
    tip: Floats | None = None
    tip_covariance: Floats | None = None
    common_sigma: float = 0.0
    shift: Floats = field(default_factory=lambda: np.zeros(2))
    shift_covariance: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    remark: str = ""
    lost_light: Floats = field(default_factory=lambda: np.empty(0))
    grid_error: GridError | None = None

    def __post_init__(self) -> None:
        count = len(freeze(self, "points", (None, 2)))
        directions = freeze(self, "directions", (count, 2))
        sigma = freeze(self, "sigma", (count,))
        if not (sigma > 0).all():
            raise ValueError(f"sigma is {sigma.min():g} at a point, allowed are numbers > 0")
        if not (np.abs(np.hypot(*directions.T) - 1) < _UNIT).all():
            raise ValueError("directions has rows that are no unit vectors")
        if not np.size(self.lost_light):
            object.__setattr__(self, "lost_light", np.zeros(count))
        freeze(self, "lost_light", (count,))


def down_columns(points: Floats, sigma: Floats) -> Centreline:
    """Make the centreline of points (n, 2), each measured along its image column."""
    return Centreline(points, np.tile([0.0, 1.0], (len(points), 1)), sigma)
