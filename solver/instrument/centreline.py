"""The beam as an image shows it: points with their errors, and where there should be more."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Grey, frozen_floats


class Flag(IntEnum):
    """Why a place where the beam should be gave no point."""

    HIDDEN = 1
    SATURATED = 2
    FOREIGN = 3


@dataclass(frozen=True)
class Centreline:
    """Points (n, 2) [px], as (u, v), each measured along its unit `directions` (n, 2).

    A point errs along its direction alone: down the image column in which it was measured, or
    along the row where the beam is steep. `sigma` (n,) [px]. `rejected` (m, 2) [px] are places
    where the beam should be and was not measured, `flags` (m,) why. `tip` (2,) [px] is the image
    of the beam's free end and `tip_covariance` (2, 2) [px^2] its error; None where it is not seen.
    `common_sigma` [px] is the error, along the directions, that all points share. `remark` says how
    the image differs from the rest images, "" where it does not.
    """

    points: Floats
    directions: Floats
    sigma: Floats
    rejected: Floats = field(default_factory=lambda: np.empty((0, 2)))
    flags: npt.NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, np.uint8))
    tip: Floats | None = None
    tip_covariance: Floats | None = None
    common_sigma: float = 0.0
    remark: str = ""

    def __post_init__(self) -> None:
        points = frozen_floats("points", self.points, (None, 2))
        directions = frozen_floats("directions", self.directions, (len(points), 2))
        sigma = frozen_floats("sigma", self.sigma, (len(points),))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "sigma", sigma)


Extractor = Callable[[Grey], Centreline]


def down_columns(points: Floats, sigma: Floats) -> Centreline:
    """The centreline of points (n, 2), each measured down its image column."""
    return Centreline(points, np.tile([0.0, 1.0], (len(points), 1)), sigma)
