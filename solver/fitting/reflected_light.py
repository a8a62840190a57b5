"""Light that an object reflects onto the beam: it brightens the beam's near side.

The beam's apparent middle moves beside the contact, differently ahead of it and behind it. The
objects of a rig may be alike: this error is partly the same in all frames.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import BentBeam
from solver.fitting.frame_problem import (
    LEAST_REFLECTION,
    REFLECTED,
    SHARED_VARIANCE_FRACTION,
    FrameProblem,
    P,
    reflection,
    with_common_errors,
    with_own_errors,
)
from solver.instrument.arrays import Floats
from solver.uniform.residuals import SIGMA_X, SIGMA_Y, X, Y

# Distance from the contact at which half of it is left. Chosen: an object of the size of
# `push_joint.RADIUS_SIGMA`.
_OBJECT: Final = 0.05


class TouchedPlace(NamedTuple):
    """Image of a contact on plane C: `place` (2,) over the length, `direction` (2,) of the beam."""

    place: Floats
    direction: Floats


def touched_place(problem: FrameProblem, p: Floats) -> TouchedPlace:
    """Compute the contact of a fit with parameters p (p,)."""
    bent = problem.bent(p)
    assert bent is not None, "the fit has a shape"
    return places_of(bent)[0]


def places_of(bent: BentBeam) -> list[TouchedPlace]:
    """Return the contacts of a shape, from the clamp outwards."""
    return [
        TouchedPlace(np.array([x, y]), np.array([math.cos(theta), math.sin(theta)]))
        for _, theta, x, y, *_ in bent.contacts
    ]


def reflection_matters(problem: FrameProblem) -> bool:
    """Test whether the light that an object reflects may move the points by part of their sigma."""
    return reflection(problem.points, problem.beam.radius) > LEAST_REFLECTION


def lit_by_object(problem: P, touch: TouchedPlace) -> P:
    """Add the light that an object reflects, as errors of the frame's own."""
    return with_own_errors(problem, _light(problem, touch))


def lit_by_objects(problem: P, touch: TouchedPlace) -> P:
    """Add the light that an object reflects, of which a part is the same in all frames."""
    light = _light(problem, touch)
    problem = with_common_errors(problem, math.sqrt(SHARED_VARIANCE_FRACTION) * light)
    return with_own_errors(problem, math.sqrt(1 - SHARED_VARIANCE_FRACTION) * light)


def _light(problem: FrameProblem, touch: TouchedPlace) -> Floats:
    """Compute the shift of the points (n, 2), in sigmas: beside the contact, and ahead of it."""
    x, y = (problem.points[[X, Y]] - touch.place[:, None]) / _OBJECT
    shift = REFLECTED * problem.beam.radius / (1 + x * x + y * y)
    sigmas = np.hypot(problem.points[SIGMA_X], problem.points[SIGMA_Y])
    ahead = x * touch.direction[0] + y * touch.direction[1]
    return np.column_stack([shift / sigmas, ahead * shift / sigmas])
