"""Place and force of a weight that hangs from the beam: a dead load.

Its direction is gravity's, fixed in the world while the motor turns and the beam bends, so that the
force is inclined against the beam's normal by a known angle; the contact of `exact_fit` has a
normal force, or one that friction inclines by an unknown angle. The direction is `gravity` in
rig.json, in plane C, in which the beam bends. The beam and its clamp are those of `exact_fit`, with
the same priors; there is no friction.
"""

import math
from functools import partial

from solver.fitting.frame_estimate import frame_estimate
from solver.fitting.hung_problem import direction_of_load, hung_problem_of
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

# Largest angle between gravity and the beam's normal at the clamp. Chosen: beyond it the weight
# pulls along the beam rather than across.
_MAX_ANGLE = math.radians(70)


def hung_weight(measurement: Measurement) -> Estimate:
    """Estimate place and force of a hung weight, with their joint covariance."""
    rig = measurement.rig
    if rig.gravity is None:
        return Estimate(Outcome.INVALID, "rig.json states no direction of gravity")
    if rig.known_psi:
        return Estimate(Outcome.INVALID, "a hung weight bends the beam in plane C only")
    angle = direction_of_load(measurement, rig.gravity)
    if abs(angle) > _MAX_ANGLE:
        return Estimate(
            Outcome.INVALID,
            f"gravity pulls at {math.degrees(abs(angle)):.0f} deg from the side to which contact "
            f"bends the beam, allowed are {math.degrees(_MAX_ANGLE):.0f} deg",
        )
    return frame_estimate(measurement, partial(hung_problem_of, gravity=rig.gravity)).estimate
