"""Determine the sliding direction of a contact with friction from the motor's motion alone.

While the motor pushes on, the beam slides past the object towards the clamp, because a bent beam is
longer than the distance it spans: the object drags it towards the tip. Only at first, while the
beam turns on its thickness more than it bends, does it slide the other way. In linear theory, with
the beam's share a of the deflection of beam and object, the beam slides towards the clamp by

    x0 delta^2 (1/2 - a + 3/5 a^2) - r delta (3/2 a - 1)

up to the pushing angle delta (r: the beam's radius), which has its minimum at 2.5 r / x0 for a
rigid object; friction and the object's radius hardly move it. From there on the contact is held
until friction has changed its sign. When the motor turns back, the contact is held at first, too;
then it slides back. A beam held at a point is so stiff that this held phase is short: with
coefficients up to 0.8, rigid, soft and round objects, and pushes up to 25 degrees it never exceeded
7 % of the way from first contact to the motor's reversal.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats

# Share of the first reversal's angle up to which the beam certainly slides the first way. Chosen:
# the reversal is known to 2 %.
CERTAIN: Final = 0.95
# The contact is held up to the reversal's angle times one plus this, times the root of the beam's
# slenderness. Chosen: 1.6 to 1.8 for beams of slenderness 0.04 to 0.07. With a friction coefficient
# of 0.5 their contacts were still held at 1.3; the held phase grows with the root of it.
HELD: Final = 3.0


def ratio_matrix(
    pushing_angles: Floats,
    begins: Sequence[bool],
    sigma: float,
    slenderness: float,
    softest: float,
) -> Floats:
    """Build the matrix (n, m) that maps m unknowns to friction ratios of n frames, in their order.

    The first unknown is Coulomb's coefficient: the friction ratio of a sliding contact is plus this
    (towards the tip) or minus this (back). The others are the friction ratios of contacts that may
    be held, one each. `pushing_angles` (n,) [rad] are from first contact, known to `sigma`;
    `begins` (n,) is True where the beam was free before; `slenderness` is the beam's radius over
    the contact distance, and `softest` the largest possible compliance of the object, over the
    beam's own.
    """
    starts = [i for i, free_before in enumerate(begins) if free_before or i == 0]
    angles = np.asarray(pushing_angles)
    signs = np.concatenate([_signs(part, sigma) for part in np.split(angles, starts[1:])])
    early = angles < _reversal(0.0) * slenderness * (1 + HELD * math.sqrt(slenderness))
    certain = CERTAIN * slenderness * _reversal(softest)
    first_way = (signs > 0) & (angles > 0) & (angles < certain)
    signs[early] = np.where(first_way, -1.0, 0.0)[early]
    held = np.flatnonzero(signs == 0)
    matrix = np.zeros((len(signs), 1 + len(held)))
    matrix[:, 0] = signs
    matrix[held, 1 + np.arange(len(held))] = 1.0
    return matrix


def _reversal(compliance: float) -> float:
    """Compute the pushing angle at which sliding reverses first, over the slenderness.

    `compliance` is the object's over the beam's own. The beam slides one way only on a soft object.
    """
    share = 1 / (1 + compliance)
    return max((1.5 * share - 1) / (1 - 2 * share + 1.2 * share**2), 0.0)


def _signs(angles: Floats, sigma: float) -> Floats:
    """Compute the sliding signs (n,): 1 on the way on, -1 back, 0 if the contact may be held.

    If the motor never passes the first frame's angle, it may have turned back before.
    """
    signs = np.zeros(len(angles))
    direction, reversal, farthest = 1.0, 0.0, 0.0
    for i, angle in enumerate(angles):
        if direction * (angle - farthest) < -THRESHOLDS.back_sigmas * sigma:
            direction, reversal, farthest = -direction, farthest, angle
        elif direction * (angle - farthest) > 0:
            farthest = angle
        sliding = abs(farthest - reversal) > THRESHOLDS.held_fraction * abs(reversal)
        signs[i] = direction if sliding else 0.0
    if len(angles) > 1 and angles.max() - angles[0] <= THRESHOLDS.back_sigmas * sigma:
        signs[0] = 0.0
    return signs
