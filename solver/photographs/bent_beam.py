"""Contact and tip of a bent beam in plane C.

The parameters p (k + 5,) are those of shape and clamp, as in `beams.beam`, in units of the beam's
length; every gradient is by all of them. The beam bends towards y.
"""

import numpy as np

from solver.beams.beam import S_C, BentBeam
from solver.beams.dead_load import Quantity, turn_of
from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z

# Nodes and weights on (0, 1). Chosen: four integrate a bow of three coefficients to 1e-9.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def contact_place(bent: BentBeam, p: Floats) -> Quantity:
    """Compute the place (2,) of the contact in plane C."""
    return _turned(bent, p, bent.contacts[0, 2:4], bent.by_contacts[0, 2:4])


def tip_place(bent: BentBeam, p: Floats, at_rest: slice) -> Quantity:
    """Compute the place (2,) of the tip, the arc length 1, in plane C.

    Beyond the contact the beam has its curvature at rest, so that its tangent turns by the
    difference of the slopes of the line at rest, whose bow is the part `at_rest` of p.
    """
    values, gradients, k = bent.contacts[0], bent.by_contacts[0], len(bent.by_moment)
    bow = p[at_rest]
    powers = np.arange(len(bow)) + 2.0
    span = 1 - p[S_C]
    places = p[S_C] + span * (1 + _NODES) / 2
    slopes = powers * places[:, None] ** (powers - 1) - powers * p[S_C] ** (powers - 1)
    angles = values[1] + slopes @ bow
    tangents = np.column_stack([np.cos(angles), np.sin(angles)])
    normals = np.column_stack([-np.sin(angles), np.cos(angles)])
    weights = span * _WEIGHTS / 2
    by_angle = np.zeros((len(angles), k)) + gradients[1]
    by_angle[:, at_rest] += slopes
    # Derivative by the lower limit, at which the angle is that of the contact.
    curvature = powers * (powers - 1) * p[S_C] ** (powers - 2) @ bow
    by_angle[:, S_C] -= curvature
    gradient = gradients[2:4] + (weights[:, None] * normals).T @ by_angle
    gradient[:, S_C] -= [np.cos(values[1]), np.sin(values[1])]
    # The places of the nodes move with the limit; the integral does not depend on them.
    return _turned(bent, p, values[2:4] + weights @ tangents, gradient)


def _turned(bent: BentBeam, p: Floats, place: Floats, by_shape: Floats) -> Quantity:
    """Rotate a place (2,) from the clamp's tangent to plane C."""
    turn = turn_of(bent, p)
    rotation = turn_about_z(float(turn.value))[:2, :2]
    gradient = np.zeros((2, len(p)))
    gradient[:, : len(bent.by_moment)] = rotation @ by_shape
    turned = rotation @ place
    gradient += np.array([-turned[1], turned[0]])[:, None] * turn.gradient
    return Quantity(turned, gradient)
