"""Units: factors to SI, and the unit that a name at the border of the program states."""

import functools
import math
from typing import Final, NamedTuple

# Multiply to convert to SI, divide to convert from SI.
MILLIMETRE = 1e-3
DEGREE = math.pi / 180
PERCENT = 1e-2
GRAM = 1e-3  # kg
MICRO = 1e-6  # microseconds, parts per million
NEWTON_SQUARE_MILLIMETRE = 1e-6  # flexural rigidity, N mm^2 -> N m^2


class Unit(NamedTuple):
    """Unit: the suffix that states it in names, its text, and its factor to SI."""

    suffix: str
    text: str
    factor: float


# Longest suffix first. A name without one of them is a number without unit or a text.
_UNITS: Final = (
    Unit("_mm_per_n", "mm/N", MILLIMETRE),
    Unit("_n_per_m", "N/m", 1.0),
    Unit("_per_mm2", "1/mm^2", 1 / MILLIMETRE**2),
    Unit("_n_mm2", "N mm^2", NEWTON_SQUARE_MILLIMETRE),
    Unit("_pct_L", "% of L", PERCENT),
    Unit("_n_mm", "N mm", MILLIMETRE),
    Unit("_n_m", "N/m", 1.0),  # of stiffnesses; no quantity is in N m
    Unit("_pct", "%", PERCENT),
    Unit("_deg", "deg", DEGREE),
    Unit("_rad", "rad", 1.0),
    Unit("_mpa", "MPa", 1e6),
    Unit("_mm2", "mm^2", MILLIMETRE**2),
    Unit("_mm", "mm", MILLIMETRE),
    Unit("_px", "px", 1.0),
    Unit("_ms", "ms", 1e-3),
    Unit("_n", "N", 1.0),
    Unit("_g", "g", GRAM),
    Unit("", "", 1.0),
)


@functools.cache
def unit_of(name: str) -> Unit:
    """Return the unit that the name of a key or column states by its suffix."""
    return next(unit for unit in _UNITS if name.endswith(unit.suffix))
