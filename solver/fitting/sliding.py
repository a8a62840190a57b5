"""Determine the sliding direction of a contact with friction from the motor's motion alone.

While the motor pushes on, the beam slides past the object towards the clamp, because a bent beam is
longer than the distance it spans: the object drags it towards the tip. Only at first, while the
beam turns on its thickness more than it bends, does it slide the other way. When the motor turns
back, the contact is held at first (it sticks); then it slides back. A beam held at a point is so
stiff that the held phase is short: with coefficients up to 0.8, rigid, soft and round objects, and
pushes up to 25 degrees it never exceeded 7 % of the way from first contact to the motor's reversal.
"""

from collections.abc import Sequence

import numpy as np

from solver.fitting.thresholds import LIMITS
from solver.instrument.arrays import Floats


def grip_matrix(
    pushing_angles: Floats, begins: Sequence[bool], sigma: float, slenderness: float
) -> Floats:
    """Build the matrix (n, m) that maps m unknowns to the grips of n frames, in their order.

    The first unknown is Coulomb's coefficient: the grip of a sliding contact is plus this (towards
    the tip) or minus this (back). The others are the grips of contacts that may be held, one each.
    `pushing_angles` (n,) [rad] are from first contact, known to `sigma`; `begins` (n,) is True
    where the beam was free before; `slenderness` is the beam's radius over the contact distance.
    """
    starts = [i for i, free_before in enumerate(begins) if free_before or i == 0]
    parts = np.split(np.asarray(pushing_angles), starts[1:])
    signs = np.concatenate([_signs(part, sigma) for part in parts])
    signs[np.asarray(pushing_angles) < LIMITS.min_sliding_angle * slenderness] = 0.0
    held = np.flatnonzero(signs == 0)
    matrix = np.zeros((len(signs), 1 + len(held)))
    matrix[:, 0] = signs
    matrix[held, 1 + np.arange(len(held))] = 1.0
    return matrix


def _signs(angles: Floats, sigma: float) -> Floats:
    """Compute the sliding signs (n,): 1 on the way on, -1 back, 0 if the contact may be held.

    If the motor never passes the first frame's angle, it may have turned back before.
    """
    signs = np.zeros(len(angles))
    direction, reversal, farthest = 1.0, 0.0, 0.0
    for i, angle in enumerate(angles):
        if direction * (angle - farthest) < -LIMITS.back_sigmas * sigma:
            direction, reversal, farthest = -direction, farthest, angle
        elif direction * (angle - farthest) > 0:
            farthest = angle
        sliding = abs(farthest - reversal) > LIMITS.held_fraction * abs(reversal)
        signs[i] = direction if sliding else 0.0
    if len(angles) > 1 and angles.max() - angles[0] <= LIMITS.back_sigmas * sigma:
        signs[0] = 0.0
    return signs
