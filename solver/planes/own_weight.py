"""Bow of a beam in plane C that its own weight causes as the beam turns and bends.

The line at rest contains the beam's sag, which is taken for a bow. Turned and bent, the beam has
another curvature by its weight w per metre,

    k(s) = integral from s to L of (r(t) - r(s)) x w dt / EI
         = (integral from s to L of (L - t) r'(t) dt) x w / EI

(Antman 2005, ch. IV). Less the same at rest, it is that of a bow which a weightless beam of this
shape would have. The shape r is the one that the image shows. What the form of the bow, a
polynomial of degree 4, leaves of it is small, and moves the points along their normals.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from solver.instrument.arrays import Floats

# Steps of the integrals along the beam. Derived: their error is 1e-4 of the bow.
_STEPS: Final = 64


class SelfWeight(NamedTuple):
    """Direction (n,) [rad] of a beam, in the frame of the beam at rest, and its `sag` (2,).

    The sag is w L^3 / (8 EI), along the weight: that of the tip over the length where the beam is
    straight and across the weight.
    """

    angle: Floats
    sag: Floats

    def curvature(self, s: Floats) -> Floats:
        """Compute the curvature (n,) by the weight, times the length, at places s (n,) over it."""
        direction = np.stack([np.cos(self.angle), np.sin(self.angle)])
        arm = cumulative_trapezoid((1 - s) * direction, s, initial=0)
        x, y = arm[:, -1:] - arm
        return np.asarray(8 * (x * self.sag[1] - y * self.sag[0]))


class OwnWeight(NamedTuple):
    """Coefficients (3,) of s^2, s^3, s^4 of a bow, and what it lacks at n points (n,)."""

    bow: Floats
    remainder: Floats


def bow_by_own_weight(
    x: Floats, turn: Floats, bow: Floats, sag: Floats, sag_at_rest: Floats
) -> OwnWeight:
    """Compute the change of the bow since rest.

    All is in the frame of the beam at rest, and over the beam's length. `x` (n,) are points of the
    beam, from the clamp on, and `turn` (n,) [rad] its direction there; `bow` (3,) are the
    coefficients at rest. `sag` and `sag_at_rest` (2,) are those of `SelfWeight`.
    """
    s = np.linspace(0.0, 1.0, _STEPS + 1)
    arc = cumulative_trapezoid(1 / np.cos(np.append(0.0, turn)), np.append(0.0, x), initial=0)
    now = SelfWeight(np.interp(s, arc, np.append(0.0, turn)), sag)
    at_rest = SelfWeight(
        np.arctan(s * (2 * bow[0] + s * (3 * bow[1] + s * 4 * bow[2]))), sag_at_rest
    )
    # The bow whose line, not whose curvature, is nearest.
    slope = cumulative_trapezoid(now.curvature(s) - at_rest.curvature(s), s, initial=0)
    line = cumulative_trapezoid(slope, s, initial=0)
    powers = np.stack([s**2, s**3, s**4], axis=-1)
    coefficients = np.asarray(np.linalg.lstsq(powers, line)[0], np.float64)
    return OwnWeight(coefficients, np.interp(arc[1:], s, line - powers @ coefficients))
