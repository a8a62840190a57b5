"""Which way a contact with friction slides, from the motor's way alone.

While the motor pushes on, the beam slides past the object towards the clamp, for a bent beam is
longer than the distance it spans: the object drags it towards the tip. Only at first, while the
beam turns on its thickness more than it bends, it slides the other way. When the motor turns back
the contact is held at first; then it slides back. A beam held at a point is so stiff that this
takes little: with coefficients up to 0.8, objects rigid, soft and round, and pushes up to 25
degrees it never took more than 7 % of the way from first contact to where the motor turned.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats

# A contact may be held for this share of the way from first contact to the turn.
HELD: Final = 0.1
# A motor that is behind its farthest by more sigmas of its encoder has turned back.
_BACK: Final = 3.0
# In beam radii over contact distance: at smaller pushing angles the beam may slide either way.
_FIRST: Final = 3.0


def grip_matrix(
    pushing_angles: Floats, begins: Sequence[bool], sigma: float, slenderness: float
) -> Floats:
    """The matrix (n, m) that makes the grips of n frames, in their order, from m unknowns.

    The first unknown is Coulomb's coefficient: of a contact that slides the grip is this, towards
    the tip or back. The others are the grips of contacts that may be held, each its own.
    `pushing_angles` (n,) [rad] are from first contact, known to `sigma`; `begins` (n,) says where
    the beam was free before; `slenderness` is the beam's radius over the contact distance.
    """
    starts = [i for i, first in enumerate(begins) if first or i == 0]
    parts = np.split(np.asarray(pushing_angles), starts[1:])
    signs = np.concatenate([_signs(part, sigma) for part in parts])
    signs[np.asarray(pushing_angles) < _FIRST * slenderness] = 0.0
    held = np.flatnonzero(signs == 0)
    made = np.zeros((len(signs), 1 + len(held)))
    made[:, 0] = signs
    made[held, 1 + np.arange(len(held))] = 1.0
    return made


def _signs(angles: Floats, sigma: float) -> Floats:
    """Of the way on (1) and back (-1), zero where the contact may be held (n,).

    A motor that never passes the first frame's angle may have turned before.
    """
    signs = np.zeros(len(angles))
    direction, turned, farthest = 1.0, 0.0, 0.0
    for i, angle in enumerate(angles):
        if direction * (angle - farthest) < -_BACK * sigma:
            direction, turned, farthest = -direction, farthest, angle
        elif direction * (angle - farthest) > 0:
            farthest = angle
        slides = abs(farthest - turned) > HELD * abs(turned)
        signs[i] = direction if slides else 0.0
    if len(angles) > 1 and angles.max() - angles[0] <= _BACK * sigma:
        signs[0] = 0.0
    return signs
