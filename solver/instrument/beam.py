"""Dimensions and flexural rigidity of the beam."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Beam:
    """A straight beam of circular section: length [m], diameter [m], flexural rigidity EI [N m^2].

    Assumption 5 of the paper: the section is circular and constant.
    """

    length: float
    diameter: float
    flexural_rigidity: float

    def __post_init__(self) -> None:
        for name in ("length", "diameter", "flexural_rigidity"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"beam.{name} is {value}, allowed is a positive number")

    @property
    def radius(self) -> float:
        """Radius of the section [m]."""
        return self.diameter / 2


def circular_rigidity(youngs_modulus: float, diameter: float) -> float:
    """Compute EI [N m^2] of a circular section, I = pi d^4 / 64, from E [Pa] and d [m]."""
    return youngs_modulus * math.pi * diameter**4 / 64
