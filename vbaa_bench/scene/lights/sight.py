"""The beam as a light sees it: tangents between the directions to the light and to the camera."""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.rig import MAX_LIGHT_SLOPE

# Sigma of the tangent to a lamp. Chosen: its place is measured to 1 cm at a distance of 0.35 m.
PLACE_SIGMA: Final = 0.03
# Height above plane C of lamps in or below it, whose light grazes. Chosen: ten times the least
# distance that rig.json states.
_LOWEST_MM: Final = 1e-5


class Tangent(NamedTuple):
    """Tangent between the directions to a light and to the camera, its sigma and gradient.

    The gradient [1/mm] is the tangent's change along the beam.
    """

    slope: float
    sigma: float
    gradient: float


# Light without shading: from around the lens, or from behind the beam.
NO_SHADING: Final = Tangent(0.0, 0.0, 0.0)


class Sight(NamedTuple):
    """The camera, seen from the `middle` (3,) [mm] of the beam, along an axis of plane C.

    `to_camera` is the tangent of the direction to the camera, and `convergence` [1/mm] its change
    along the beam.
    """

    middle: Floats
    axis: int
    to_camera: float
    convergence: float

    def to(self, place_mm: Floats, area_mm2: float) -> Tangent:
        """Compute the tangent to a light at (3,) [mm] with an area [mm^2] that faces the beam.

        The mean direction of the light from a wide lamp changes less than that to its middle:
        before a disc of radius R at distance d, as from a small lamp at d + R^2 / d (Lambert 1760).
        """
        away = place_mm - self.middle
        wider = 1 + area_mm2 / (math.pi * float(away @ away))
        height = max(float(place_mm[2]), _LOWEST_MM)
        slope = bounded((place_mm[self.axis] - self.middle[self.axis]) / height - self.to_camera)
        gradient = self.convergence - 1 / (height * wider)
        return Tangent(slope, PLACE_SIGMA, float(gradient))


def bounded(slope: float) -> float:
    """Limit a slope to those that rig.json may state."""
    return float(np.clip(slope, -MAX_LIGHT_SLOPE, MAX_LIGHT_SLOPE))
