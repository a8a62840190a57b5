"""The exact fit with a beam that was learned from other pushes of the same rig.

The beam is learned before the first frame, from the frames of the split "learn", or from all frames
of a set without splits. Each frame is then estimated from itself alone. Where the pushes show no
beam, it is the stated one.
"""

from collections.abc import Callable
from dataclasses import replace

from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit


def exact_fit_learned(measurement: Measurement) -> Estimate:
    """Estimate contact, force and displacement with the rig's learned beam."""
    return exact_fit(measurement)


def exact_fit_stated(reason: str) -> Callable[[Measurement], Estimate]:
    """Return the method for pushes that show no beam: `exact_fit`, whose messages say why."""

    def fit(measurement: Measurement) -> Estimate:
        estimate = exact_fit(measurement)
        message = f"with the stated beam, because none was learned: {reason}"
        return replace(estimate, message="; ".join(filter(None, (message, estimate.message))))

    return fit
