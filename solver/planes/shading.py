"""Shift of the beam's shading as it bends: its bright side turns towards the light.

A cylinder is brightest on the side of the light. Its middle in the image is therefore beside its
axis, by SHADING radii times t, the tangent between the directions to the light and to the camera,
across the beam. The rest pose contains this shift at rest; only its change is corrected. As the
beam turns by an angle a and moves by y towards the light, t changes by

    t = g y cos(a) - (slope + g (x - L/2)) sin(a),    g = w/z_v - 1/d,

where `slope` is t along the beam at its middle, d the light's distance, and V = (x_v, y_v, z_v, w)
the viewpoint: the direction to a lamp at the distance of the camera changes as that to the camera.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.rig import Rig

# Shift of the middle of the shading, in radii at t = 1. Derived, for a matt cylinder: the
# brightness sqrt(1 - x^2) + t x has its middle at t (2/3) / (pi/2).
SHADING: Final = 4 / (3 * math.pi)
# Its relative sigma. Measured: matt, glossy and bare beams lit from the side moved by 1.0 to 1.6
# times as much.
SHADING_SIGMA: Final = 0.3
# Largest shift of the middle of the shading, in radii. Derived, for a matt cylinder in light that
# grazes it: the brightness x, on the lit half only, has its middle at (1/3) / (1/2).
MAX_SHADING: Final = 2 / 3


class Shading(NamedTuple):
    """Shift (n,) [m] of each point's shading along its normal since rest, and errors (n, 2) [m].

    The errors are one sigma each of two independent ones, which all points share: of the light's
    direction, and of the shift's size.
    """

    shift: Floats
    errors: Floats


def shading_of(
    rig: Rig, viewpoint: Floats, response: float, x: Floats, moved: Floats, turn: Floats
) -> Shading:
    """Compute the shift of the shading at n points, where the beam has turned by `turn` (n,) [rad].

    `x` (n,) [m] are their distances from the clamp along Sigma_a's x axis, `moved` (n,) [m] how far
    they are from the line at rest. `viewpoint` (4,) is the camera's, and `response` is the shift of
    the measured place over that of the shading.
    """
    *_, height, w = viewpoint
    gradient = 0.0 if rig.light.distance is None else w / height - 1 / rig.light.distance
    along = rig.light.slope + gradient * (x - rig.beam.length / 2)
    size, sine = SHADING * response * rig.beam.radius, np.sin(turn)
    shift = size * (gradient * moved * np.cos(turn) - along * sine)
    errors = np.stack([size * rig.light.slope_sigma * sine, SHADING_SIGMA * shift], axis=1)
    return Shading(shift, errors)


def axis_sigma(rig: Rig, response: float) -> float:
    """Compute the sigma [m] of the beam's axis about its apparent middle at rest, across the beam.

    The rest pose is that of the apparent middle. Contact distance and force depend only on changes
    since rest; the place in Sigma_a depends on the axis. `response` is that of `shading_of`.
    """
    shift = SHADING * abs(response) * rig.light.across
    return min(shift, MAX_SHADING) * rig.beam.radius
