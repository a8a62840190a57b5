"""Position of the clamp relative to the motor's axis, in the section `base` of rig.json."""

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from solver.instrument.arrays import Floats, frozen_floats
from solver.instrument.keys import Keys
from solver.instrument.units import MILLIMETRE

# Chosen: as the largest position of a clamp, a million beams away.
_MAX_MM: Final = 1e6


@dataclass(frozen=True)
class ClampOffset:
    """Position (2,) [m] of the clamp relative to the motor's axis, in x and y of Sigma_a.

    `covariance` (2, 2) [m^2] is its uncertainty. By default the clamp is on the axis (the paper's
    assumption 4). Raises ValueError if a shape is wrong or a value is not finite.
    """

    position: Floats = field(default_factory=lambda: np.zeros(2))
    covariance: Floats = field(default_factory=lambda: np.zeros((2, 2)))

    def __post_init__(self) -> None:
        position = frozen_floats("clamp offset", self.position, (2,))
        object.__setattr__(self, "position", position)
        covariance = frozen_floats("covariance of the clamp offset", self.covariance, (2, 2))
        object.__setattr__(self, "covariance", covariance)

    @property
    def none(self) -> bool:
        """Whether the clamp is certainly on the axis."""
        return not (self.position.any() or self.covariance.any())


ON_AXIS: Final = ClampOffset()


def clamp_offset_keys(offset: ClampOffset) -> dict[str, Any]:
    """Return the keys of an offset in the section `base`; none if the clamp is on the axis."""
    if offset.none:
        return {}
    return {
        "clamp_offset_mm": (offset.position / MILLIMETRE).tolist(),
        "clamp_offset_covariance_mm2": (offset.covariance / MILLIMETRE**2).tolist(),
    }


def read_clamp_offset(key: Keys) -> ClampOffset:
    """Read the offset: its position and, as measured, its sigma or, as learned, its covariance.

    Raises InputError, also where the camera is fixed in the world: the clamp would then move in the
    image while the motor turns, which no method expects.
    """
    position, covariance = np.zeros(2), np.zeros((2, 2))
    if key.has("base.clamp_offset_mm"):
        position = key.pair("base.clamp_offset_mm", -_MAX_MM, _MAX_MM) * MILLIMETRE
    if key.has("base.clamp_offset_covariance_mm2"):
        name, limit = "base.clamp_offset_covariance_mm2", _MAX_MM**2
        covariance = key.matrix(name, -limit, limit, 2) * MILLIMETRE**2
        # Twelve digits are written: eigenvalues may be negative by their rounding.
        least = -1e-9 * float(np.trace(covariance))
        symmetric = np.array_equal(covariance, covariance.T)
        if not symmetric or np.linalg.eigvalsh(covariance)[0] < least:
            key.refuse(name, "a symmetric matrix without negative eigenvalues")
    elif key.has("base.clamp_offset_sigma_mm"):
        sigma = key.number("base.clamp_offset_sigma_mm", 0, _MAX_MM) * MILLIMETRE
        covariance = np.eye(2) * sigma**2
    offset = ClampOffset(position, covariance)
    if not offset.none and key.has("camera.mount"):
        # A camera that is fixed in the world shows where the clamp is at every motor angle.
        key.one_of("camera.mount", ("antenna",))
    return offset
