"""Direction of gravity in rig.json, along which a hung weight pulls."""

import math
from dataclasses import dataclass

from solver.instrument.keys import Keys
from solver.instrument.units import DEGREE


@dataclass(frozen=True)
class Gravity:
    """Direction of gravity in plane C, and its sigma [rad].

    `direction` is the angle in Sigma_o from x towards y. Raises ValueError if a value is not finite
    or the sigma is negative.
    """

    direction: float
    sigma: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.direction) and 0 <= self.sigma < math.inf):
            raise ValueError(f"gravity is {self.direction} +- {self.sigma}, allowed is finite")


def gravity_keys(gravity: Gravity) -> dict[str, float]:
    """Return the keys of the section `gravity` of rig.json."""
    return {
        "direction_deg": gravity.direction / DEGREE,
        "direction_sigma_deg": gravity.sigma / DEGREE,
    }


def read_gravity(key: Keys) -> Gravity | None:
    """Read the section `gravity`; return None if the rig states no gravity. Raises InputError."""
    if not key.has("gravity"):
        return None
    return Gravity(
        key.number("gravity.direction_deg", -360, 360) * DEGREE,
        key.number("gravity.direction_sigma_deg", 0, 180) * DEGREE,
    )
