"""The exact fit with a beam that was learned from other pushes of the same rig.

The beam is learned before the first frame, from the frames of the split "learn", or from all frames
of a set without splits. Each frame is then estimated from itself alone.
"""

from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit


def exact_fit_learned(measurement: Measurement) -> Estimate:
    """Estimate contact, force and displacement with the rig's learned beam."""
    return exact_fit(measurement)
