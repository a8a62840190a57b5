"""Determine the direction of friction at a rigid object from the bend of one frame.

An object that does not yield stays at its distance from the motor's axis. So while the motor pushes
on, without friction, the contact's place s_c on the beam changes by

    ds_c/dq = -(d|P|/dq) / (d|P|/ds_c),

with the load q and the point P of the beam's surface at the contact, seen from the motor's axis.
At first the beam turns on its thickness: |P| grows, and the beam slides towards the object. Once it
bends more than it turns, |P| shrinks, and it slides back. For a uniform, straight beam in linear
theory d|P|/dq falls in proportion to the pushing angle, and is 0 at 2.5 radii over the contact
distance; taper, bow, the clamp and its offset are in P.

The contact is held for a while when the direction changes, as `sliding` describes.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import FRICTION_RATIO, S_C, Q
from solver.fitting.frame_problem import FrameProblem, P
from solver.fitting.sliding import CERTAIN, HELD
from solver.instrument.arrays import Floats

# Load at first contact, over that of the frame. Chosen: there the beam is hardly bent.
_FIRST: Final = 1e-3


class _Growth(NamedTuple):
    """Growth d|P|/dq of the contact's distance from the axis, at first contact and now.

    `straight` is that at first contact of a straight beam whose clamp is on the axis.
    """

    first: float
    now: float
    straight: float


def friction_sign_of(problem: FrameProblem, p: Floats) -> int:
    """Return the sign of the friction ratio at a rigid object, of a fit with parameters p (p,).

    It is 1 where the object drags the beam towards its tip, -1 towards its clamp, and 0 where the
    contact may be held.
    """
    growth = _growth(problem, p)
    # Where bow and offset cancel the thickness, errors of a part of it decide.
    at_first = max(growth.first, growth.straight)
    if growth.now < -HELD * math.sqrt(problem.beam.radius / p[S_C]) * at_first:
        return 1
    return -1 if growth.now > (1 - CERTAIN) * at_first else 0


def with_friction_sign(problem: P, sign: int) -> P:
    """Return the problem with the prior of friction of this sign, 0 if it is not known."""
    if problem.rigid is None or not sign:
        return replace(problem, friction_sign=sign)
    mean, information = problem.mean.copy(), problem.information.copy()
    coefficient, sigma = problem.rigid.friction
    mean[FRICTION_RATIO], information[FRICTION_RATIO, FRICTION_RATIO] = (
        sign * coefficient,
        sigma**-2,
    )
    return replace(problem, mean=mean, information=information, friction_sign=sign)


def _growth(problem: FrameProblem, p: Floats) -> _Growth:
    assert problem.rigid is not None, "the rig states that objects are rigid"
    shape = p.copy()
    shape[FRICTION_RATIO] = 0.0
    radius = problem.beam.radius_at(shape, float(shape[S_C])).value
    found: list[float] = []
    straight = 0.0
    for load in (_FIRST * shape[Q], shape[Q]):
        shape[Q] = load
        bent = problem.bent(shape)
        assert bent is not None, "a smaller load than that of the fit has a shape"
        (_, theta, x, y, *_), (_, turn, along, across, *_) = (
            bent.contacts[-1],
            bent.by_contacts[-1, :, Q],
        )
        normal = np.array([math.sin(theta), -math.cos(theta)])
        tangent = np.array([math.cos(theta), math.sin(theta)])
        arm = np.array([x, y]) + radius * normal - problem.rigid.axis
        moved = np.array([along, across]) + radius * turn * tangent
        found.append(float(arm @ moved) / math.hypot(*arm))
        straight = straight or radius * float(turn - across / x)
    first, now = found
    return _Growth(first, now, straight)
