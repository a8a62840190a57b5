"""Places on a bent beam in plane C, with their gradients.

The parameters q (k + 5,) are those of shape and clamp, as in `beams.beam`, in units of the length
of the beam that bends. The beam bends towards y.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from solver.beams.beam import DX, DY, POSE, S_C, Beam, BentBeam
from solver.beams.curve import END, SLOPE, P, U
from solver.beams.dead_load import Quantity, turn_of
from solver.instrument.arrays import Floats, Mask

# Step of the differences. Chosen: between rounding, 1e-10, and curvature, 1e-6, of the gradient.
_STEP: Final = 1e-6


def places_on(bent: BentBeam, q: Floats, arcs: Floats) -> Floats:
    """Compute the places (n, 2) in plane C at arc lengths (n,) from where the beam bends."""
    curve = bent.curve
    lever, height, angle = curve.base
    # Nodes are at equal arc lengths ahead of the contact, and behind it; it has one in both parts.
    ahead = q[S_C] + (END - q[S_C]) * np.linspace(1, 0, curve.contact + 1)
    behind = np.linspace(q[S_C], 0, curve.nodes.shape[1] - len(ahead))
    arc, nodes = np.append(ahead, behind[1:]), np.delete(curve.nodes, curve.contact + 1, axis=1)
    i = np.clip(np.searchsorted(-arc, -arcs) - 1, 0, len(arc) - 2)
    step, slope = arc[i] - arc[i + 1], nodes[SLOPE]
    cosine = 1 / np.sqrt(1 + slope**2)
    # Cubic through places and tangents (Hermite), by the part of the step from the outer node.
    t = (arc[i] - arcs) / step
    r = 1 - t
    weights = r * r * (1 + 2 * t), t * t * (1 + 2 * r), -step * t * r * r, step * t * t * r
    along, across = (
        weights[0] * place[i]
        + weights[1] * place[i + 1]
        + weights[2] * tangent[i]
        + weights[3] * tangent[i + 1]
        for place, tangent in ((lever - nodes[U], cosine), (nodes[P] - height, -slope * cosine))
    )
    turn = angle + float(turn_of(bent, q).value)
    sine, cosine, k = math.sin(turn), math.cos(turn), len(q) - POSE
    x, y = along * cosine - across * sine, along * sine + across * cosine
    return np.column_stack([x + q[k + DX], y + q[k + DY]])


def with_gradient(
    beam: Beam, bent: BentBeam, q: Floats, used: Mask, of: Callable[[BentBeam, Floats], Floats]
) -> Quantity:
    """Compute places (n, 2) and their gradient (n, 2, k + 5) by the parameters `used` (k + 5,).

    The other parameters have the gradient 0.
    """
    value = of(bent, q)
    gradient = np.zeros((*value.shape, len(q)))
    for i in np.flatnonzero(used):
        moved = q.copy()
        moved[i] += _STEP
        shape = beam.bent(moved[:-POSE])
        if shape is not None:
            gradient[:, :, i] = (of(shape, moved) - value) / _STEP
    return Quantity(value, gradient)
