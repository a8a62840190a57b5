"""Image -> sub-pixel centreline, with a sigma for every point."""

from dataclasses import dataclass

from solver.instrument.arrays import Floats, frozen_floats


@dataclass(frozen=True)
class Centreline:
    """Points (n, 2) [px], as (u, v): one a column, u exact; `sigma` (n,) [px] is that of v."""

    points: Floats
    sigma: Floats

    def __post_init__(self) -> None:
        points = frozen_floats("points", self.points, (None, 2))
        sigma = frozen_floats("sigma", self.sigma, (len(points),))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "sigma", sigma)
