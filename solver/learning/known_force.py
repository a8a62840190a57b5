"""EI from one known force: images determine how EI changes along the beam, but not its scale."""

import math
from dataclasses import replace

from solver.instrument.beam import Beam
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Rig
from solver.methods import Method
from solver.methods.exact_fit import exact_fit


def rig_with_force(
    rig: Rig, measurement: Measurement, force: float, sigma: float, method: Method = exact_fit
) -> Rig:
    """Return the rig with EI and its sigma from one known force [N].

    `rig` has the learned beam; `measurement` shows it under the force: that of a contact, as of a
    balance, or a hung weight where that is the `method`. The force is estimated with the rig's EI,
    to which it is proportional. The sag in plane C follows from EI, and changes with it. Raises
    InputError for a force that is not positive, or a measurement in which the method finds none.
    """
    if not (math.isfinite(force) and force > 0 and math.isfinite(sigma) and sigma >= 0):
        raise InputError(
            f"the known force is {force:g} +- {sigma:g} N, allowed is a positive force with a "
            "sigma from 0"
        )
    certain = replace(rig.tolerances, flexural_rigidity=0.0)
    assumed = replace(rig, tolerances=certain, shape=replace(rig.shape, rigidity_sigma=0.0))
    estimate = method(replace(measurement, rig=assumed))
    if not estimate.values:
        reason = estimate.message or estimate.outcome
        raise InputError(f"the frame of the known force or weight does not show it: {reason}")
    estimated = estimate.values["force_n"]
    rigidity = rig.beam.flexural_rigidity * force / estimated
    relative = math.hypot(sigma / force, estimate.sigma("force_n") / estimated)
    return replace(
        assumed,
        sag_in_plane=rig.sag_in_plane * estimated / force,
        beam=Beam(rig.beam.length, rig.beam.diameter, rigidity),
        tolerances=replace(certain, flexural_rigidity=relative * rigidity),
    )
