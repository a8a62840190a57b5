"""Which way a contact with friction slides, from the motor's way alone.

While the motor pushes on, the beam slides past the object towards the clamp, for a bent beam is
longer than the distance it spans: the object drags it towards the tip. When the motor turns back
the contact is held at first; then it slides the other way. A beam held at a point is so stiff that
this takes little: with coefficients up to 0.8, objects rigid, soft and round, and pushes up to 25
degrees it never took more than 7 % of the way from first contact to where the motor turned.
"""

from typing import Final

import numpy as np

from solver.instrument.arrays import Floats

# A contact may be held for this share of the way from first contact to the turn.
HELD: Final = 0.1
# A motor that is behind its farthest by more sigmas of its encoder has turned back.
_BACK: Final = 3.0


def grips(pushing_angles: Floats, sigma: float) -> Floats:
    """The matrix (n, m) that makes the frames' grips from m unknowns, n frames in their order.

    The first unknown is Coulomb's coefficient: of a contact that slides the grip is this, towards
    the tip or back. The others are the grips of contacts that may be held, each its own.
    `pushing_angles` (n,) [rad] are from first contact, known to `sigma`.
    """
    signs = np.zeros(len(pushing_angles))
    direction, turned, farthest = 1.0, 0.0, 0.0
    for i, angle in enumerate(pushing_angles):
        if direction * (angle - farthest) < -_BACK * sigma:
            direction, turned, farthest = -direction, farthest, angle
        elif direction * (angle - farthest) > 0:
            farthest = angle
        slides = abs(farthest - turned) > HELD * abs(turned)
        signs[i] = direction if slides else 0.0
    held = np.flatnonzero(signs == 0)
    made = np.zeros((len(signs), 1 + len(held)))
    made[:, 0] = signs
    made[held, 1 + np.arange(len(held))] = 1.0
    return made
